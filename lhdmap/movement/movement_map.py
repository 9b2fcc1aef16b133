"""The Topological Movement's Map (paper, Section 3.2): six states a point, edges by the rules, costs in seconds, as CSR arrays.

State `6 p + k` is state k (of `lhdmap.movement.rules`) at point p. Ways that are infeasible or closed never become edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.movement.costs import Pace, edge_costs
from lhdmap.movement.rules import STANDING_AGAINST, STANDING_ALONG, STATE_COUNT, STATES, reversed_kind, rule_pairs
from lhdmap.movement.ways import Ints, Ways
from lhdmap.topology.model import KINDS

GEARS = np.array([state.gear for state in STATES], dtype=np.int8)
TURN = -1
"""The way of an edge that turns the machine round on the spot, in a turning bay."""


@dataclass(frozen=True)
class Edges:
    """E edges in compressed rows: those of state s are `first[s]` to `first[s + 1]`, with `to` (E,), `cost_s` and `way` (E,)."""

    first: Ints
    to: Ints
    cost_s: FloatArray
    way: Ints


@dataclass(frozen=True)
class MovementMap:
    """The states and edges over `ways`, for one pace."""

    ways: Ways
    pace: Pace
    edges: Edges

    @property
    def state_count(self) -> int:
        """Number of states."""
        return len(self.edges.first) - 1

    @cached_property
    def backward(self) -> Edges:
        """The same edges from their ends: `to` holds where each comes from."""
        edges = self.edges
        origin = np.repeat(np.arange(self.state_count, dtype=np.int32), np.diff(edges.first))
        return _rows(edges.to, origin, edges.cost_s, edges.way, self.state_count)


def movement_map(ways: Ways, pace: Pace, *, blocked_too: bool = False) -> MovementMap:
    """Build the movement map; `blocked_too`: as if nothing were infeasible or closed, to find what stands in the way."""
    count = STATE_COUNT * ways.point_count
    sound = np.isfinite(ways.length_m) & (ways.length_m >= 0.0) & (ways.limit_mps > 0.0)
    origin, to, way = _edges_by_rule(ways, sound & (blocked_too | (ways.blocked == 0)))
    from_k, to_k = origin % STATE_COUNT, to % STATE_COUNT
    from_stop, to_stop = from_k >= STANDING_ALONG, to_k >= STANDING_ALONG
    gear = np.where(to_stop, GEARS[from_k], GEARS[to_k])
    cost_s = edge_costs(ways, pace, way, gear, from_stop, to_stop)
    bays = np.flatnonzero(ways.bays).astype(np.int32) * STATE_COUNT
    along, against = bays + STANDING_ALONG, bays + STANDING_AGAINST
    origin, to = np.concatenate([origin, along, against]), np.concatenate([to, against, along])
    way = np.concatenate([way, np.full(2 * len(bays), TURN, np.int32)])
    cost_s = np.concatenate([cost_s, np.full(2 * len(bays), pace.turn_s)])
    return MovementMap(ways, pace, _rows(origin, to, cost_s, way, count))


def _edges_by_rule(ways: Ways, usable: npt.NDArray[np.bool_]) -> tuple[Ints, Ints, Ints]:
    """Return origin, end and way of all edges (E,) that the rules give, both ways along each usable way."""
    parts: list[tuple[Ints, Ints, Ints]] = []
    for within in (True, False):
        for k, kind in enumerate(KINDS):
            chosen = np.flatnonzero(usable & (ways.within == within) & (ways.kind == k)).astype(np.int32)
            if len(chosen):
                parts.append(_spread(ways.start[chosen], ways.end[chosen], chosen, rule_pairs(kind, within=within)))
                back = rule_pairs(reversed_kind(kind), within=within)
                parts.append(_spread(ways.end[chosen], ways.start[chosen], chosen, back))
    if not parts:
        return (np.empty(0, np.int32),) * 3
    origin, to, way = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return origin, to, way


def _spread(start: Ints, end: Ints, way: Ints, pairs: list[tuple[int, int]]) -> tuple[Ints, Ints, Ints]:
    from_k, to_k = (np.array(column, dtype=np.int32) for column in zip(*pairs, strict=True))
    origin = (start[:, None] * STATE_COUNT + from_k).ravel()
    to = (end[:, None] * STATE_COUNT + to_k).ravel()
    return origin, to, np.repeat(way, len(pairs))


def _rows(origin: Ints, to: Ints, cost_s: FloatArray, way: Ints, count: int) -> Edges:
    order = np.argsort(origin, kind="stable")
    first = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(np.bincount(origin, minlength=count), out=first[1:])
    return Edges(first, to[order].astype(np.int32), cost_s[order], way[order].astype(np.int32))
