"""The next best ways, and why they lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.movement.blocks import blocks_on, toll_of
from lhdmap.movement.movement_map import TURN
from lhdmap.movement.places import Place
from lhdmap.movement.route import Alternative, Route
from lhdmap.movement.steps import Sequence
from lhdmap.movement.ways import Bools

if TYPE_CHECKING:
    from lhdmap.movement.routes import RoutePlanner

_MOST_TRIED = 32  # links of the best route that are left out in turn; of a longer route, as many evenly along it
_SHORTER_S = 0.05


def alternatives_of(
    planner: RoutePlanner, best: Route, found: Sequence, begin: Place, end: Place, avoided: Bools, count: int
) -> Route:
    """Return the best route with the `count` best others beside it, each through another sequence of nodes.

    As in Yen's method, one step deep: each link between two nodes of the best route is left out once. The first of all is the way
    that would be quicker if nothing were blocked. Where the exact times turn the order round, the quicker one is the best.
    """
    others = {best.nodes: best}
    for route in _tried(planner, found, begin, end, avoided):
        known = others.get(route.nodes)
        others[route.nodes] = route if known is None or route.time_s < known.time_s else known
    order = sorted(others.values(), key=lambda route: route.time_s)
    best = order[0]
    lost = [_alternative(route, best) for route in order[1 : count + 1]]
    blocked = _if_free(planner, best, begin, end, avoided)
    return replace(best, alternatives=(*([] if blocked is None else [blocked]), *lost))


def _tried(planner: RoutePlanner, found: Sequence, begin: Place, end: Place, avoided: Bools) -> Iterator[Route]:
    links = [int(way) for way in dict.fromkeys(found.ways.tolist()) if way != TURN and not planner.ways.within[way]]
    every = max(1.0, len(links) / _MOST_TRIED)
    toll = np.zeros(len(avoided)) if (given := toll_of(avoided)) is None else given
    for k in range(min(len(links), _MOST_TRIED)):
        way = links[int(k * every)]
        without = toll.copy()
        without[way] = np.inf
        other = planner.sequence(begin.standing(), end, without)
        if other is not None:
            yield planner.told(other)


def _if_free(planner: RoutePlanner, best: Route, begin: Place, end: Place, avoided: Bools) -> Alternative | None:
    """Return the way that would be quicker if nothing were blocked, closed or avoided; None where there is none."""
    if not (avoided.any() or (planner.ways.blocked > 0).any()):
        return None
    found = planner.sequence(begin.standing(), end, None, everywhere=True)
    if found is None:
        return None
    route = planner.told(found)
    blocks = tuple(blocks_on(planner.topology, planner.ways, found, avoided))
    if not blocks or route.time_s > best.time_s - _SHORTER_S:
        return None
    told = ", ".join(f"{one.start}:{one.end} ({one.why}{f': {one.text}' if one.text else ''})" for one in blocks)
    lost = f"{best.time_s - route.time_s:.1f} s quicker, but blocked by {told}"
    return Alternative(route.nodes, route.distance_m, route.time_s, route.inversions, lost, blocks)


def _alternative(route: Route, best: Route) -> Alternative:
    more_m, more_s, inversions = (
        route.distance_m - best.distance_m,
        route.time_s - best.time_s,
        route.inversions - best.inversions,
    )
    reasons = [f"{more_s:.1f} s longer" if more_s >= _SHORTER_S else "as quick"]
    reasons += [f"{abs(more_m):.1f} m {'more' if more_m > 0 else 'less'}"] if abs(more_m) >= _SHORTER_S else []
    if inversions:
        word = "inversion" if abs(inversions) == 1 else "inversions"
        reasons.append(f"{abs(inversions)} {word} {'more' if inversions > 0 else 'less'}")
    return Alternative(route.nodes, route.distance_m, route.time_s, route.inversions, ", ".join(reasons))
