"""The topological map of LCAS topological_navigation (tmap2, YAML): nodes with a pose, directed edges between them.

Nodes are the places; a way gives an edge there and one back, for nav2's NavigateToPose, which plans between them on the occupancy
grid. An access point is driven through both ways, so its heading binds nothing (`yaw_goal_tolerance` of half a turn).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError
from lhdmap.exports.content import Content
from lhdmap.exports.places import Place, Way, drivable_ways, places_graph, unique_names
from lhdmap.names import name_of

ACTION, ACTION_TYPE = "NavigateToPose", "geometry_msgs/PoseStamped"
NEAR_M, NEAR_RAD = 0.5, 0.1
"""Where a goal counts as reached. Assumed: what a loader needs at a draw point."""
ZONE_M = 2.0
"""Half the size of the square round a node in which the machine counts as being there. Assumed: within a drift of 4.5 m."""


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the map.

    Raises:
        InputError: nothing in the map can be driven.
    """
    from ruamel.yaml import YAML

    graph = places_graph(content.topology, content.times_s)
    ways = drivable_ways(graph)
    if not ways:
        raise InputError(f"{content.folder.path}: no connection that can be driven; a map without an edge is of no use")
    name = name_of(content.folder.path)
    names = unique_names(graph)
    edges: list[list[dict[str, Any]]] = [[] for _ in graph.places]
    for way in ways:
        for a, b in ((way.start, way.end), (way.end, way.start)):
            edges[a].append(_edge(names[a], names[b], way, sum(one["node"] == names[b] for one in edges[a])))
    nodes = [_node(place, names[k], edges[k], name, content.frame) for k, place in enumerate(graph.places)]
    table = {
        "meta": {"last_updated": content.folder.info.get("software", "lhdmap")},
        "metric_map": name,
        "name": name,
        "pointset": name,
        "transformation": {
            "parent": content.frame,
            "child": "topo_map",
            "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
            "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        },
        "nodes": nodes,
    }
    yaml = YAML()
    yaml.representer.ignore_aliases = lambda _: True  # its readers are people, too
    with at(path).open("w", encoding="utf-8") as file:
        yaml.dump(table, file)
    return {"nodes": len(nodes), "edges": sum(map(len, edges))}


def _node(place: Place, called: str, edges: list[dict[str, Any]], name: str, frame: str) -> dict[str, Any]:
    x, y, z, yaw = (float(value) for value in place.points[0].pose)
    corners = [(-ZONE_M, -ZONE_M), (ZONE_M, -ZONE_M), (ZONE_M, ZONE_M), (-ZONE_M, ZONE_M)]
    through = place.kind in ("access_point", "pass")
    return {
        "meta": {"map": name, "node": called, "pointset": name},
        "node": {
            "name": called,
            "parent_frame": frame,
            "localise_by_topic": "",
            "pose": {
                "position": {"x": round(x, 4), "y": round(y, 4), "z": round(z, 4)},
                "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)},
            },
            "properties": {
                "xy_goal_tolerance": NEAR_M,
                "yaw_goal_tolerance": math.pi if through else NEAR_RAD,
                "kind": place.kind,
            },
            "restrictions_planning": "True",
            "restrictions_runtime": "True",
            "verts": [{"x": dx, "y": dy} for dx, dy in corners],
            "edges": edges,
        },
    }


def _edge(start: str, end: str, way: Way, before: int) -> dict[str, Any]:
    """Return an edge; `before`: how many edges already join the two, its id tells them apart."""
    return {
        "edge_id": f"{start}_{end}" + (f"_{before + 1}" if before else ""),
        "node": end,
        "action": ACTION,
        "action_type": ACTION_TYPE,
        "config": [],
        "fail_policy": "fail",
        "fluid_navigation": True,
        "goal": {"target_pose": {"header": {"frame_id": "$node.parent_frame"}, "pose": "$node.pose"}},
        "recovery_behaviours_config": "",
        "restrictions_planning": "True",
        "restrictions_runtime": "True",
        "properties": {
            "length_m": round(way.connection.length_m, 3),
            "time_s": round(way.time_s, 3),
            "within": way.node,
        },
    }
