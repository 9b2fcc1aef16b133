"""The ways of a topological map as arrays: its connections, and the links between an access point and its twin."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.topology.model import KINDS, Connection, TopologicalMap, Waypoint

Ints = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]
Why = Literal["", "infeasible", "closed", "avoided"]
WHYS: tuple[Why, ...] = ("", "infeasible", "closed", "avoided")
LINK = KINDS.index("front_front")


@dataclass(frozen=True)
class Ways:
    """W ways between P points (indices), each drivable both ways.

    `start`, `end` (W,): the points; `kind` (W,): index in KINDS; `within` (W,): a connection within a node, else a link of length
    0 between twins. `length_m`, `limit_mps` (W,): of its connection and tunnel, inf for links. `blocked` (W,): index in WHYS, 0 is
    free. `bays` (P,): where the machine can turn round. `peak_mps` (P,): the highest speed on any free way at the point.
    """

    start: Ints
    end: Ints
    kind: Ints
    within: Bools
    length_m: FloatArray
    limit_mps: FloatArray
    blocked: npt.NDArray[np.int8]
    bays: Bools

    @property
    def point_count(self) -> int:
        """Number of points."""
        return len(self.bays)

    @property
    def peak_mps(self) -> FloatArray:
        """Highest limit (P,) of the free connections at each point, m/s; 0 where there is none."""
        peak = np.zeros(self.point_count)
        usable = self.within & (self.blocked == 0)
        np.maximum.at(peak, self.start[usable], self.limit_mps[usable])
        np.maximum.at(peak, self.end[usable], self.limit_mps[usable])
        return peak


def ways_of(topology: TopologicalMap) -> Ways:
    """Return the ways of a map: its connections in their order, then the links; points in the order of `topology.points`.

    A connection between points that are not there is left out; so is the link of an access point whose twin does not join it. One
    without a length or a speed is infeasible. A closed tunnel closes the ways to it through its intersections, too: a machine
    that only inverts there would stand in it with half its length.
    """
    index = {name: k for k, name in enumerate(topology.points)}
    connections = known_connections(topology)
    links = twin_pairs(topology)
    count = len(links)
    limits = {one.id: one.speed_limit_kmh for one in topology.tunnels}
    closed = {one.id for one in topology.tunnels if one.closed or not one.speed_limit_kmh > 0.0}
    shut = arms_of(topology, closed)
    nodes = [topology.points[one.start].node for one in connections]
    return Ways(
        _ints([index[one.start] for one in connections] + [index[a] for a, _ in links]),
        _ints([index[one.end] for one in connections] + [index[b] for _, b in links]),
        _ints([KINDS.index(one.kind) for one in connections] + [LINK] * count),
        np.array([True] * len(connections) + [False] * count, dtype=np.bool_),
        np.array([one.length_m for one in connections] + [0.0] * count, dtype=float),
        np.array(
            [
                min(one.speed_limit_kmh, limits.get(node, np.inf)) / 3.6
                for one, node in zip(connections, nodes, strict=True)
            ]
            + [np.inf] * count
        ),
        np.array(
            [
                _why(one, node in closed or bool({one.start, one.end} & shut))
                for one, node in zip(connections, nodes, strict=True)
            ]
            + [0] * count,
            dtype=np.int8,
        ),
        np.array(
            [isinstance(one, Waypoint) and one.purpose == "turning_bay" for one in topology.points.values()], bool
        ),
    )


def known_connections(topology: TopologicalMap) -> list[Connection]:
    """Return the connections whose points are both in the map."""
    return [one for one in topology.connections if {one.start, one.end} <= topology.points.keys()]


def arms_of(topology: TopologicalMap, nodes: AbstractSet[str]) -> set[str]:
    """Return the access points (ids) of other nodes that join one of `nodes` (ids)."""
    points = topology.points
    return {one.id for one in topology.access_points if one.joins in points and points[one.joins].node in nodes}


def twin_pairs(topology: TopologicalMap) -> list[tuple[str, str]]:
    """Return the pairs of access points (ids) that join each other, each pair once."""
    joins = {one.id: one.joins for one in topology.access_points}
    pairs: dict[frozenset[str], tuple[str, str]] = {}
    for one, other in joins.items():
        if other is not None and other != one and joins.get(other) == one:
            pairs.setdefault(frozenset((one, other)), (one, other))
    return list(pairs.values())


def _why(one: Connection, closed: bool) -> int:
    if not one.feasible or not 0.0 <= one.length_m < np.inf or not one.speed_limit_kmh > 0.0:
        return WHYS.index("infeasible")
    return WHYS.index("closed") if one.closed or closed else 0


def _ints(values: list[int]) -> Ints:
    return np.array(values, dtype=np.int32)
