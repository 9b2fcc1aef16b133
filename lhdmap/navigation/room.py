"""Room for a change of gear: where the machine stands in the mouth of a short drift, one end of it is deep inside.

The route over the map compares radii and swept bodies; how far a body reaches beyond the point where the gear changes is told
here, and a way that ends without room for it is avoided. Before a draw point the pile's toe ends the room: low rock is below the
scanners.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from lhdmap.movement.route import Route, Step
from lhdmap.topology.model import DEAD_END, UNEXPLORED, TopologicalMap, Tunnel, Waypoint

_TRIES = 12
_ENDS = {DEAD_END, UNEXPLORED}


def room_m(topology: TopologicalMap, step: Step, nose_m: float) -> float:
    """Return how far a machine may reach beyond a point at the mouth of a drift; infinite where the drift does not end.

    `nose_m`: how far the machine reaches before `base_link` where it stands at a draw point or a dump.
    """
    point = topology.points[step.point]
    joins = getattr(point, "joins", None)
    names = [step.node] if joins is None else [step.node, topology.points[joins].node]
    for name in names:
        node = topology.nodes.get(name)
        if not isinstance(node, Tunnel) or not _ENDS & set(node.ends):
            continue
        mouth = node.line_m[-1 if node.ends[0] in _ENDS else 0]
        gone = float(np.linalg.norm(point.pose[:2] - mouth[:2]))
        stands = [
            float(np.linalg.norm(one.pose[:2] - mouth[:2])) + nose_m
            for one in topology.points_of(node.id)
            if isinstance(one, Waypoint) and one.purpose in ("draw_point", "dump")
        ]
        return max(min([node.length_m, *stands]) - gone, 0.0)
    return math.inf


def with_room(
    topology: TopologicalMap,
    ask: Callable[[tuple[str, ...]], Route],
    avoid: tuple[str, ...],
    nose_m: float,
    tail_m: float,
    spare_m: float,
) -> Route:
    """Return the best route on which each change of gear has room; `ask` plans without some ways (`A:B`).

    `tail_m`: how far the machine reaches behind `base_link`.
    """
    route = ask(avoid)
    for _ in range(_TRIES):
        short = _short(topology, route, nose_m, tail_m, spare_m)
        if not route.feasible or short is None:
            return route
        avoid = (*avoid, short)
        route = ask(avoid)
    return route


def _short(topology: TopologicalMap, route: Route, nose_m: float, tail_m: float, spare_m: float) -> str | None:
    """Return the way to the first change of gear without room."""
    for before, step in pairwise(route.states):
        if not step.inversion or before.point == step.point:
            continue
        reach = nose_m if before.gear == "forward" else tail_m
        if room_m(topology, step, nose_m) < reach + spare_m:
            return f"{before.point}:{step.point}"
    return None
