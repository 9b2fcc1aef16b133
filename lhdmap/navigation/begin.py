"""From where the machine stands to a point of the map that a route can begin at."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.movement.route import Route
from lhdmap.movement.routes import RouteOptions, RoutePlanner
from lhdmap.navigation.along import facing
from lhdmap.navigation.room import with_room
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import Point, TopologicalMap, Tunnel


class Begin(NamedTuple):
    """A point (id) that a route may begin at, how far the machine is from it (m), and how far (m) other points (ids) are.

    `towards_m`: of the points of its tunnel, in the direction in which the machine is; negative behind.
    """

    point: str
    away_m: float
    towards_m: Mapping[str, float] = {}


class Errand(NamedTuple):
    """A goal, the heading (rad) of the machine in `map`, and ways that are closed."""

    goal: str
    heading_rad: float
    closed: tuple[str, ...]


class Reach(NamedTuple):
    """How far the machine reaches before and behind `base_link`, and the room wanted beyond that where the gear changes."""

    nose_m: float
    tail_m: float
    spare_m: float


def route_from(planner: RoutePlanner, point: str, errand: Errand, reach: Reach) -> Route:
    """Return the route from a point to the goal on which each change of gear has room, and the machine at the goal."""
    topology = planner.topology
    heading = f"{math.degrees(errand.heading_rad):.1f}"
    ends = facing(topology, errand.goal, reach.tail_m)
    asked = RouteOptions(heading=heading, goal_heading=ends, alternatives=0)

    def ask(avoid: tuple[str, ...]) -> Route:
        return planner.route(point, errand.goal, replace(asked, avoid=avoid))

    route = with_room(topology, ask, errand.closed, *reach)
    if not route.feasible and ends != facing(topology, errand.goal):
        # Bucket first was wanted for the room alone: better backed to than not at all.
        asked = replace(asked, goal_heading=None)
        route = with_room(topology, ask, errand.closed, *reach)
    return route


def passed_by(topology: TopologicalMap, nodes: Iterable[str], begins: Iterable[Begin], goal: str) -> list[str]:
    """Return which nodes (ids) a route is to keep out of: all in which it neither begins nor ends."""
    ends = {topology.points[one.point].node for one in begins} | {getattr(topology.called(goal), "node", "")}
    return [node for node in nodes if node not in ends]


def begins_at(topology: TopologicalMap, place: FloatArray, goal: str) -> list[Begin]:
    """Return where routes from a place (x, y, z) to a goal may begin: in a tunnel the next point to each side, else the nearest.

    It is never the goal itself, to which the machine has to drive.
    """
    nodes = Lookup(topology).nodes_at(np.asarray(place, dtype=float)[None])
    node = topology.nodes.get(nodes[0])
    end = getattr(topology.called(goal), "id", "")
    points = [] if node is None else [one for one in topology.points_of(node.id) if one.id != end]
    if node is None or not points:
        return []
    if not isinstance(node, Tunnel):
        near = min(points, key=lambda one: _apart(one, place))
        return [Begin(near.id, _apart(near, place))]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(node.line_m, axis=0), axis=1))])
    at = _along(node, way, place)
    every = {one.id: _along(node, way, one.pose[:3]) - at for one in topology.points_of(node.id)}
    ordered = sorted((every[one.id], one.id) for one in points)
    before, after = [one for one in ordered if one[0] <= 0.0][-1:], [one for one in ordered if one[0] > 0.0][:1]
    return [
        Begin(name, abs(off), {other: (every[other] - off) * (-1.0 if off > 0.0 else 1.0) for other in every})
        for off, name in (*before, *after)
    ]


def best_begin(begins: list[Begin], ask: Callable[[str], Route]) -> tuple[Begin, Route]:
    """Return from which of several (at least one) the way is shortest, and its route: `ask` plans from a point."""
    found = [(one, ask(one.point)) for one in begins]
    return min(found, key=lambda pair: _cost_m(*pair))


def _cost_m(begin: Begin, route: Route) -> float:
    """Return how far it is from where the machine stands; a route that leads past it is shorter by what lies behind."""
    if not route.feasible:
        return np.inf
    following = next((step.point for step in route.states if step.point != begin.point), begin.point)
    towards_m = begin.towards_m.get(following, -1.0)
    if towards_m <= 0.0:
        return route.distance_m + begin.away_m
    return route.distance_m - begin.away_m if towards_m >= begin.away_m else np.inf  # it would end before the machine


def _along(tunnel: Tunnel, way: FloatArray, place: FloatArray) -> float:
    return float(way[int(np.linalg.norm(tunnel.line_m - place[:3], axis=1).argmin())])


def _apart(point: Point, place: FloatArray) -> float:
    return float(np.linalg.norm(point.pose[:3] - place[:3]))
