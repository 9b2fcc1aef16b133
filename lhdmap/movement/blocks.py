"""What stands in the way: the blocked ways on a path that was searched as if they were free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.movement.movement_map import TURN
from lhdmap.movement.route import Block
from lhdmap.movement.steps import Sequence
from lhdmap.movement.ways import WHYS, Bools, Ways, known_connections, twin_pairs
from lhdmap.topology.model import TopologicalMap


def toll_of(avoided: Bools) -> FloatArray | None:
    """Return the toll (W,) that keeps a search off avoided ways; None where there are none."""
    return np.where(avoided, np.inf, 0.0) if avoided.any() else None


def tolls_of_all(ways: Ways, avoided: Bools) -> FloatArray:
    """Return the tolls (W,) with which a search over all ways finds what would open one: rather closed than infeasible ways."""
    infeasible = ways.blocked == WHYS.index("infeasible")
    tolls: FloatArray = np.where(infeasible, 1e9, np.where(avoided | (ways.blocked > 0), 1e6, 0.0))
    return tolls


def blocks_on(topology: TopologicalMap, ways: Ways, sequence: Sequence, avoided: Bools) -> Iterator[Block]:
    """Yield the blocked and avoided ways of a sequence of states, each once, in its order."""
    connections = known_connections(topology)
    for way in dict.fromkeys(int(way) for way in sequence.ways if way != TURN):
        why = WHYS[int(ways.blocked[way])] or ("avoided" if avoided[way] else "")
        if not why:
            continue
        if way < len(connections):
            one = connections[way]
            yield Block(one.start, one.end, topology.points[one.start].node, why, one.reason)
        else:
            start, end = twin_pairs(topology)[way - len(connections)]
            yield Block(start, end, topology.points[start].node, why)
