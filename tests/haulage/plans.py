"""Topological maps of the mine plans that ship, drawn from the plans' own truth: no drive, no scan, straight connections."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import MinePlan, find_plan, load_plan
from lhdmap.mine.topology import topology_json
from lhdmap.topology.model import (
    AccessPoint,
    Connection,
    Intersection,
    Purpose,
    TopologicalMap,
    Tunnel,
    Waypoint,
)

_PURPOSES: dict[str, Purpose] = {
    "draw_point": "draw_point", "dump": "dump", "park": "park", "turning_bay": "turning_bay", "passing_bay": "passing_bay",
}  # fmt: skip


@functools.cache
def map_of_plan(name: str) -> TopologicalMap:
    """Return the map of a plan that ships."""
    plan = load_plan(find_plan(name))
    truth = topology_json(make_network(plan), Machine())
    points: list[AccessPoint] = []
    for node in truth["intersections"]:
        for tunnel in truth["tunnels"]:
            for end in (0, 1):
                if tunnel["ends"][end] == node["name"]:
                    points += _twins(node, tunnel, end)
    waypoints = [_waypoint(place, plan, truth["tunnels"]) for place in truth["places"] if place["kind"] in _PURPOSES]
    both: list[AccessPoint | Waypoint] = [*points, *waypoints]
    places = {one.id: (one.node, one.pose) for one in both}
    ways = [
        _way(a, b, places)
        for a, b in itertools.combinations(places, 2)
        if places[a][0] == places[b][0] and not {a, b} <= {one.id for one in waypoints}
    ]
    tunnels = tuple(_tunnel(one, places) for one in truth["tunnels"])
    return TopologicalMap(
        tunnels,
        tuple(
            Intersection(one["name"], one["name"], one["degree"], np.array([*one["position"], 0.0]), np.zeros((0, 2)))
            for one in truth["intersections"]
        ),
        tuple(points),
        tuple(waypoints),
        tuple(ways),
    )


def _twins(node: dict[str, Any], tunnel: dict[str, Any], end: int) -> list[AccessPoint]:
    """Return both access points where an intersection and the end of a tunnel meet."""
    mid = 0.5 * (tunnel["from_m"] + tunnel["to_m"])
    drifts = _drifts(tunnel)
    mine = [one for one in node["access_points"] if one["drift"] == drifts[-1 if end else 0]]
    edge_m = tunnel["from_m"] if end == 0 else tunnel["to_m"]
    near = min(mine, key=lambda one: abs(one["at_m"] - edge_m) + 1e-3 * abs(one["at_m"] - mid))
    pose = np.array([*near["position"], math.radians(near["heading_deg"])])
    inner, outer = f"{node['name']}.{tunnel['name']}.{end}", f"{tunnel['name']}.{end}"
    back = pose + np.array([0.0, 0.0, 0.0, math.pi])
    return [AccessPoint(inner, node["name"], pose, outer), AccessPoint(outer, tunnel["name"], back, inner)]


def _waypoint(place: dict[str, Any], plan: MinePlan, tunnels: list[dict[str, Any]]) -> Waypoint:
    name, node = place["name"], place["name"]
    planned = next(one for one in plan.places if one.name == name)
    if planned.side == "end":  # the tunnel that ends there: the first one of its drift, or the last
        ends = [one["name"] for one in tunnels if planned.drift in _drifts(one) and "dead_end" in one["ends"]]
        node = ends[0 if planned.at_m == 0.0 else -1]
    return Waypoint(f"w.{name}", name, node, np.array(place["pose"]), _PURPOSES[place["kind"]])


def _drifts(tunnel: dict[str, Any]) -> list[str]:
    return [part.split(".")[0] for part in tunnel["name"].split("+")]


def _way(a: str, b: str, places: dict[str, tuple[str, FloatArray]]) -> Connection:
    line = np.linspace(places[a][1][:3], places[b][1][:3], 5)
    return Connection(a, b, "back_back", line, max(float(np.linalg.norm(line[-1] - line[0])), 0.5))


def _tunnel(one: dict[str, Any], places: dict[str, tuple[str, FloatArray]]) -> Tunnel:
    line = np.array([pose[:3] for node, pose in places.values() if node == one["name"]])
    first, last = one["ends"]
    if len(line) < 2:  # a dead end without a place: straight on, away from its intersection
        heading = next(float(pose[3]) for node, pose in places.values() if node == one["name"])
        far = line - one["length_m"] * np.array([math.cos(heading), math.sin(heading), 0.0])
        line = np.vstack([far, line] if first == "dead_end" else [line, far])
    half = np.full((len(line), 2), 2.3)
    return Tunnel(one["name"], one["name"], (first, last), line, half, np.array([*line[0], 0.0]))
