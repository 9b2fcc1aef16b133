"""The network of a plan.

plan -> centre lines -> meetings -> nodes and branches -> edges, turns
"""

from __future__ import annotations

from lhdmap.mine.meetings import drift_lines, meetings
from lhdmap.mine.network import Network
from lhdmap.mine.nodes import add_edges, add_nodes
from lhdmap.mine.place_tubes import with_place
from lhdmap.mine.plan import MinePlan
from lhdmap.mine.tube import Tube, rows_of
from lhdmap.mine.turns import add_turns


def make_network(plan: MinePlan) -> Network:
    """Return the network of a plan.

    Raises:
        ConfigError: lines cross without joining, a place lies beyond the end of its drift, or a junction of the plan is none.
    """
    lines = drift_lines(plan.drifts)
    names = [drift.name for drift in plan.drifts]
    tubes = [
        Tube(
            drift.name, "drift", line, rows_of(drift.width_m), rows_of(drift.height_m),
            plan.walls.roughness_m if drift.roughness_m is None else drift.roughness_m,
        )
        for drift, line in zip(plan.drifts, lines, strict=True)
    ]  # fmt: skip
    found = meetings(names, lines)
    for place in plan.places:
        tubes, found = with_place(tubes, found, place)
    network = Network(plan, tubes)
    joints = add_nodes(network, found)
    add_edges(network, joints)
    add_turns(network)
    return network
