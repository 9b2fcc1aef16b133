"""The search of a route: the cheapest way over states at the ends of edges."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

from lhdmap.mine.runs import Run


class RouteState(NamedTuple):
    """At one end of an edge: `entering` it in a direction and gear, or having come to its other end."""

    edge: int
    direction: int
    gear: int
    entering: bool


class RouteStep(NamedTuple):
    """A step of a search: what it costs (m), where it leads, and what is driven."""

    cost_m: float
    state: RouteState
    runs: tuple[Run, ...]


Starts = dict[RouteState, tuple[Run, ...]]
"""States that a search begins in, each with the runs that lead there."""


def cheapest(
    states: Starts,
    steps: Callable[[RouteState], Iterator[RouteStep]],
    reached: Callable[[RouteStep], bool],
    reverse: float,
) -> tuple[RouteState, list[Run]] | None:
    """Return the cheapest way (Dijkstra) from one of `states` to a step that is `reached`: where it ends, and the runs.

    `steps`: what can be driven from a state; `reverse`: what a metre in reverse costs.
    """
    count = itertools.count()
    queue: list[tuple[float, int, RouteState, tuple[Run, ...], tuple[object, ...]]] = []
    for state, runs in states.items():
        way = sum(abs(run.to_m - run.from_m) * (1.0 if run.gear > 0 else reverse) for run in runs)
        if runs and reached(RouteStep(way, state, runs)):
            heapq.heappush(queue, (way, next(count), state, runs, ("end",)))
        heapq.heappush(queue, (way, next(count), state, runs, ()))
    done: set[RouteState] = set()
    while queue:
        cost, _, state, runs, end = heapq.heappop(queue)
        if end:
            return state, list(runs)
        if state in done:
            continue
        done.add(state)
        for step in steps(state):
            following = (cost + step.cost_m, next(count), step.state, (*runs, *step.runs))
            if reached(step):
                heapq.heappush(queue, (*following, ("end",)))
            if step.state not in done:
                heapq.heappush(queue, (*following, ()))
    return None
