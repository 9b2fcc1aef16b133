"""Cheapest paths over a movement map, again and again: a workspace that is never cleared, and landmarks for large maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.movement.movement_map import Edges, MovementMap
from lhdmap.movement.rules import STATE_COUNT
from lhdmap.movement.search_kernel import path_to, search

Indices = npt.NDArray[np.int64]
_LANDMARKS = 4
_NONE = np.empty((0, 0)), np.empty((2, 0))


@dataclass(frozen=True)
class Path:
    """States (n,) and the edges (n - 1,) between them; `cost_s`, and how many states were looked at."""

    states: Indices
    edges: Indices
    cost_s: float
    settled: int


class Searcher:
    """Searches one set of edges between `state_count` states over `way_count` ways."""

    def __init__(self, edges: Edges, way_count: int) -> None:
        count = len(edges.first) - 1
        self._edges = edges
        self._free = np.zeros(max(way_count, 1))
        self._query = 0
        self._dist, self._ahead = np.empty(count), np.empty(count)
        self._before = np.empty(count, np.int32), np.empty(count, np.int32)
        self._marks = [np.zeros(count, np.int32) for _ in range(3)]
        self._goal_cost = np.empty(count)
        self._heap = np.empty(len(edges.to) + count), np.empty(len(edges.to) + count, np.int32)

    def path(
        self,
        sources: Indices,
        goals: Indices,
        goal_costs: FloatArray | None = None,
        toll: FloatArray | None = None,
        landmarks: Landmarks | None = None,
    ) -> Path | None:
        """Return the cheapest path from any of `sources` to any of `goals` (S,), (G,); None where there is none.

        `goal_costs` (G,) are added at the goals; `toll` (W,) on the ways, inf where one is not to be used.
        """
        extra = np.zeros(len(goals)) if goal_costs is None else goal_costs
        state, cost_s, settled = self._run(sources, goals, extra, toll, landmarks)
        if state < 0:
            return None
        states, edges = path_to(state, *self._before)
        return Path(states, edges, float(cost_s), int(settled))

    def distances(self, sources: Indices) -> FloatArray:
        """Return the costs (N,) from the nearest of `sources` to every state, inf where it cannot be reached."""
        self._run(sources, np.empty(0, np.int64), np.empty(0), None, None)
        found: FloatArray = np.where(self._marks[0] == self._query, self._dist, np.inf)
        return found

    def _run(
        self,
        sources: Indices,
        goals: Indices,
        goal_costs: FloatArray,
        toll: FloatArray | None,
        landmarks: Landmarks | None,
    ) -> tuple[int, float, int]:
        self._query += 1
        e, fees = self._edges, self._free if toll is None else toll
        table, bounds = _NONE if landmarks is None else (landmarks.table, landmarks.bounds(goals))
        given = (e.first, e.to, e.cost_s, e.way, fees, sources, goals, goal_costs, table, bounds)
        own = (self._dist, self._ahead, *self._before, *self._marks, self._goal_cost, *self._heap, self._query)
        found: tuple[int, float, int] = search(*given, *own)
        return found


@dataclass(frozen=True)
class Landmarks:
    """Costs (N, 2 L) from L landmarks (points, in any of their states) to each state, and from each state to them.

    For A* on large maps: lower bounds by the triangle inequality (Goldberg and Harrelson, Computing the shortest path: A* search
    meets graph theory, 2005). They hold as long as no edge becomes cheaper.
    """

    table: FloatArray

    def bounds(self, goals: Indices) -> FloatArray:
        """Return (2, L): the least cost from a landmark to a goal, and the largest from a goal to a landmark."""
        count = self.table.shape[1] // 2
        rows = self.table[goals]
        return np.stack([rows[:, :count].min(axis=0), rows[:, count:].max(axis=0)])


def landmarks_of(movement: MovementMap, count: int = _LANDMARKS) -> Landmarks:
    """Choose landmarks, each far from those before it, and measure to and from each state: twice `count` whole searches."""
    way_count = len(movement.ways.start)
    forward, backward = Searcher(movement.edges, way_count), Searcher(movement.backward, way_count)
    away, back, far = [], [], np.full(movement.state_count, np.inf)
    first = forward.distances(_states_at(0))
    point = int(np.argmax(np.where(np.isfinite(first), first, -1.0))) // STATE_COUNT
    for _ in range(min(count, movement.ways.point_count)):
        away.append(forward.distances(_states_at(point)))
        back.append(backward.distances(_states_at(point)))
        far = np.minimum(far, np.minimum(away[-1], back[-1]))
        point = int(np.argmax(np.where(np.isfinite(far), far, -1.0))) // STATE_COUNT
    return Landmarks(np.ascontiguousarray(np.stack([*away, *back], axis=1)))


def _states_at(point: int) -> Indices:
    return np.arange(STATE_COUNT, dtype=np.int64) + STATE_COUNT * point
