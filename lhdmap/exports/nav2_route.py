"""The route graph of nav2 (nav2_route, GeoJSON): nodes are places, edges are directed and straight.

As its GeoJsonGraphFileLoader reads it: ids are unsigned integers, unique over nodes and edges; of an edge only its ends are read,
so a bent way gets nodes of its own; an integer in the metadata is stored as one, and the scorers, which ask for floats, throw on
it: speeds, times and penalties are floats. A graph without a node or an edge is refused by it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.exports.content import Content
from lhdmap.exports.lines import thinned
from lhdmap.exports.places import KMH, Place, Way, drivable_ways, places_graph
from lhdmap.messages import FloatArray
from lhdmap.topology.model import Intersection, TopologicalMap

STRAIGHT_M = 0.3
"""How far the straight edges may leave the map's path. Assumed: a machine's margin to the wall."""
_CRS = {
    "type": "name",
    "properties": {"name": "urn:ogc:def:crs:EPSG::3857"},
}  # in nav2's samples; its loader passes it over


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the graph.

    Raises:
        InputError: nothing in the map can be driven, which nav2 would refuse.
    """
    graph = places_graph(content.topology, content.times_s)
    ways = drivable_ways(graph)
    if not ways:
        raise InputError(
            f"{content.folder.path}: no connection that can be driven; nav2 refuses a graph without an edge"
        )
    ids = count(1)
    places = {k: next(ids) for k in sorted({k for way in ways for k in (way.start, way.end)})}
    nodes = [
        _node(places[k], graph.places[k].points[0].pose, _of_place(graph.places[k]), content.frame) for k in places
    ]
    fastest_kmh = max(way.connection.speed_limit_kmh for way in ways)
    edges: list[dict[str, Any]] = []
    for way in ways:
        line = _bends(way.connection.line_m)
        between = [next(ids) for _ in line[1:-1]]
        nodes += [
            _node(one, point, {"class": "bend", "within": way.node}, content.frame)
            for one, point in zip(between, line[1:-1], strict=True)
        ]
        chain = [places[way.start], *between, places[way.end]]
        edges += _edges(chain, line, _of_way(way, content.topology, fastest_kmh), way, ids)
    table = {"type": "FeatureCollection", "name": "graph", "crs": _CRS, "features": [*nodes, *edges]}
    at(path).write_text(json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    return {"nodes": len(nodes), "edges": len(edges), "places": len(places)}


def _node(number: int, position: FloatArray, metadata: dict[str, Any], frame: str) -> dict[str, Any]:
    """Return a node; height and heading are in its metadata alone, nav2 reads two coordinates."""
    height = {"z_m": round(float(position[2]), 3)}
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [round(float(value), 4) for value in position[:2]]},
        "properties": {"id": number, "frame": frame, "metadata": metadata | height, "operations": {}},
    }


def _of_place(place: Place) -> dict[str, Any]:
    heading_deg = round(math.degrees(math.remainder(float(place.points[0].pose[3]), 2.0 * math.pi)), 4)
    return {
        "class": place.kind,
        "name": place.name,
        "points": [one.id for one in place.points],
        "within": [one.node for one in place.points],
        "heading_deg": heading_deg,
    }


def _of_way(way: Way, topology: TopologicalMap, fastest_kmh: float) -> dict[str, Any]:
    """Return what all edges of a way have: `speed_limit` in percent of the map's highest, `abs_speed_limit` in m/s."""
    limit_kmh = float(way.connection.speed_limit_kmh)
    within = topology.nodes[way.node]
    return {
        "class": "intersection" if isinstance(within, Intersection) else "tunnel",
        "within": within.name,
        "speed_limit": float(np.clip(100.0 * limit_kmh / max(fastest_kmh, 0.1), 0.0, 100.0)),
        "abs_speed_limit": limit_kmh * KMH,
        "penalty": 0.0,
    }


def _edges(
    chain: list[int], line: FloatArray, metadata: dict[str, Any], way: Way, ids: Iterator[int]
) -> list[dict[str, Any]]:
    """Return the edges along a chain of nodes and back; the way's time is shared out by length."""
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    times_s = way.time_s * lengths / max(float(lengths.sum()), 1e-9)
    steps = list(zip(pairwise(chain), pairwise(line), times_s, strict=True))
    there = [(a, b, p, q, time_s) for (a, b), (p, q), time_s in steps]
    back = [(b, a, q, p, time_s) for (a, b), (p, q), time_s in reversed(steps)]
    return [
        {
            "type": "Feature",
            "geometry": {
                "type": "MultiLineString",
                "coordinates": [[[round(float(value), 4) for value in point[:2]] for point in (p, q)]],
            },
            "properties": {
                "id": next(ids),
                "startid": a,
                "endid": b,
                "cost": float(time_s),
                "overridable": True,
                "metadata": metadata | {"abs_time_taken": float(time_s)},
                "operations": {},
            },
        }
        for a, b, p, q, time_s in (*there, *back)
    ]


def _bends(line: FloatArray) -> FloatArray:
    """Return the line (N, 3) with as few points as keep it within STRAIGHT_M in plan."""
    kept: FloatArray = line[thinned(line[:, :2], STRAIGHT_M)]
    return kept
