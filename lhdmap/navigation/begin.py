"""From where the machine stands to a point of the map that a route can begin at."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.movement.route import Route
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import Point, TopologicalMap, Tunnel


class Begin(NamedTuple):
    """A point (id) that a route may begin at, how far the machine is from it (m), and the points (ids) that it is between."""

    point: str
    away_m: float
    between: tuple[str, ...]


def begins_at(topology: TopologicalMap, place: FloatArray) -> list[Begin]:
    """Return where routes from a place (x, y, z) may begin: in a tunnel the next point to each side, else the nearest one."""
    nodes = Lookup(topology).nodes_at(np.asarray(place, dtype=float)[None])
    node = topology.nodes.get(nodes[0])
    points = [] if node is None else topology.points_of(node.id)
    if node is None or not points:
        return []
    if not isinstance(node, Tunnel):
        near = min(points, key=lambda one: _apart(one, place))
        return [Begin(near.id, _apart(near, place), ())]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(node.line_m, axis=0), axis=1))])
    at = _along(node, way, place)
    ahead = sorted(points, key=lambda one: _along(node, way, one.pose[:3]) - at)
    before = [one for one in ahead if _along(node, way, one.pose[:3]) <= at][-1:]
    after = [one for one in ahead if _along(node, way, one.pose[:3]) > at][:1]
    names = tuple(one.id for one in (*before, *after))
    return [Begin(one.id, abs(_along(node, way, one.pose[:3]) - at), names) for one in (*before, *after)]


def best_begin(begins: list[Begin], ask: Callable[[str], Route]) -> tuple[Begin, Route]:
    """Return from which of several (at least one) the way is shortest, and its route: `ask` plans from a point."""
    found = [(one, ask(one.point)) for one in begins]
    return min(found, key=lambda pair: _cost_m(*pair))


def _cost_m(begin: Begin, route: Route) -> float:
    """Return how far it is from where the machine stands; a route that leads past it is shorter by what lies behind."""
    if not route.feasible:
        return np.inf
    ahead = {step.point for step in route.states[:3]} - {begin.point}
    passes = bool(ahead & set(begin.between))
    return route.distance_m + (-begin.away_m if passes else begin.away_m)


def _along(tunnel: Tunnel, way: FloatArray, place: FloatArray) -> float:
    return float(way[int(np.linalg.norm(tunnel.line_m - place[:3], axis=1).argmin())])


def _apart(point: Point, place: FloatArray) -> float:
    return float(np.linalg.norm(point.pose[:3] - place[:3]))
