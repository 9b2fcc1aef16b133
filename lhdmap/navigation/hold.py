"""Where a machine has to stand that may not go on: before the first node of its leg that it may not enter."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import NamedTuple

from lhdmap.navigation.leg import Leg
from lhdmap.topology.model import TopologicalMap

ROOM_M = 1.0  # between the machine and the node: twice what guidance stops beside its mark and localization is off


class Hold(NamedTuple):
    """How far along the path the leading axle may go, and the node (id) that it may not enter."""

    stop_m: float = math.inf
    node: str = ""


def hold_of(topology: TopologicalMap, leg: Leg, at_m: float, free: Collection[str] | None, reach_m: float) -> Hold:
    """Return the hold on a leg for a machine whose leading axle is `at_m` along it.

    `free`: nodes (ids) that it may enter, None: all. `reach_m`: what of the machine is before its leading axle, and the room
    that is kept. What the leading axle is in already is not asked for any more.
    """
    if free is None:
        return Hold()
    for node, begin_m in _entries(topology, leg):
        if node not in free and begin_m > at_m:
            return Hold(begin_m - reach_m, node)
    return Hold()


def _entries(topology: TopologicalMap, leg: Leg) -> Iterator[tuple[str, float]]:
    """Yield the nodes of a leg in order, and where along its path each begins; the last one is what its end reaches into."""
    begin_m = leg.begin_m
    for target in leg.targets:
        yield target.node, begin_m
        begin_m = target.at_m
    beyond = beyond_of(topology, leg)
    if beyond:
        yield beyond, begin_m


def beyond_of(topology: TopologicalMap, leg: Leg) -> str:
    """Return the node (id) on the other side of a leg's last point; empty where it does not end at an access point."""
    joins = getattr(topology.points[leg.targets[-1].point], "joins", None)
    return topology.points[joins].node if joins else ""
