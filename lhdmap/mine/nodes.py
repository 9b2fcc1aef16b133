"""The nodes of a network, where tubes meet or end, and the edges between them."""

from __future__ import annotations

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.messages import FloatArray
from lhdmap.mine.meetings import Meeting
from lhdmap.mine.network import Branch, Edge, Network, Node
from lhdmap.mine.plan import BLIND, JunctionPlan
from lhdmap.mine.tube import Tube

_MERGE = 0.7  # meetings nearer than this share of both half widths are one node
_ARM_M = 1.5  # what reaches this far beyond the other drift's wall is a branch
_AT_M = 5.0  # [[junction]] at
_RUN_M = 8.0  # places on one tube that are nearer than this to each other are one
Joint = tuple[int, float]  # tube, arc length


def add_nodes(network: Network, found: list[Meeting]) -> dict[Joint, int]:
    """Make the nodes where tubes meet; return the node of each place on a tube that is in one."""
    tubes, groups = network.tubes, _grouped(network.tubes, found)
    joints: dict[Joint, int] = {}
    used: set[int] = set()
    for group in groups:
        position = np.mean([tubes[tube].pose(s)[:3] for tube, s in group], axis=0)
        given = _given(network.plan.junctions, position, used)
        branches = tuple(_branches(tubes, group))
        number = 1 + sum(node.degree > 2 for node in network.nodes)
        name = given.name if given is not None and given.name else (f"I{number}" if len(branches) > 2 else "")
        corner = JunctionPlan((0.0, 0.0, 0.0)).corner_m if given is None else given.corner_m
        for joint in group:
            joints[joint] = len(network.nodes)
        network.nodes.append(Node(name, position, branches, corner))
    if len(used) < len(network.plan.junctions):
        k = next(k for k in range(len(network.plan.junctions)) if k not in used)
        raise ConfigError(
            f"[[junction]] at = {list(network.plan.junctions[k].at)}: no drifts join within {_AT_M:g} m of it"
        )
    return joints


def _grouped(tubes: list[Tube], found: list[Meeting]) -> list[list[Joint]]:
    """Return the places on tubes that are one node, group by group, in the order of the plan."""
    groups: list[list[Joint]] = []
    for meeting in found:
        pair: list[Joint] = [(meeting.first, meeting.first_m), (meeting.second, meeting.second_m)]
        near = [group for group in groups if any(_one_node(tubes, a, b) for a in group for b in pair)]
        merged = [joint for group in near for joint in group]
        groups = [group for group in groups if group not in near]
        groups.append(list(dict.fromkeys([*merged, *pair])))
    return sorted(groups, key=min)


def _one_node(tubes: list[Tube], a: Joint, b: Joint) -> bool:
    reach = _MERGE * (tubes[a[0]].half_width_m(a[1]) + tubes[b[0]].half_width_m(b[1]))
    apart = tubes[a[0]].pose(a[1])[:3] - tubes[b[0]].pose(b[1])[:3]
    return bool(np.linalg.norm(apart) < reach)


def _given(junctions: tuple[JunctionPlan, ...], position: FloatArray, used: set[int]) -> JunctionPlan | None:
    for k, junction in enumerate(junctions):
        if k not in used and np.linalg.norm(np.array(junction.at) - position) <= _AT_M:
            used.add(k)
            return junction
    return None


def _branches(tubes: list[Tube], group: list[Joint]) -> list[Branch]:
    """Return the branches of a node: each tube to both sides, where it goes on beyond the others' walls."""
    branches = []
    for tube in dict.fromkeys(tube for tube, _ in group):
        reach = max((tubes[k].half_width_m(s) + _ARM_M for k, s in group if k != tube), default=_ARM_M)
        for first, last in _runs([s for k, s in group if k == tube]):
            if tubes[tube].length_m - last > reach:
                branches.append(Branch(tube, last, 1))
            if first > reach:
                branches.append(Branch(tube, first, -1))
    return branches


def _runs(places_m: list[float]) -> list[tuple[float, float]]:
    """Return first and last of the places on one tube that lie close together, run by run."""
    runs: list[tuple[float, float]] = []
    for s in sorted(places_m):
        if runs and s - runs[-1][1] < _RUN_M:
            runs[-1] = (runs[-1][0], s)
        else:
            runs.append((s, s))
    return runs


def add_edges(network: Network, joints: dict[Joint, int]) -> None:
    """Cut the tubes at the nodes; where one ends in the rock is a node of one branch."""
    for tube, one in enumerate(network.tubes):
        if one.place is not None and one.place.kind in BLIND:
            continue
        cuts: dict[int, list[float]] = {}
        for (k, s), node in sorted(joints.items()):
            if k == tube:
                cuts.setdefault(node, []).append(s)
        stops = sorted((*run, node) for node, places in cuts.items() for run in _runs(places))
        _cut(network, tube, stops)


def _cut(network: Network, tube: int, stops: list[tuple[float, float, int]]) -> None:
    """Add the edges of one tube, between its nodes `stops` (first m, last m, node), and to its ends where it has branches."""
    at_m, at = 0.0, None
    for first, last, node in stops:
        if Branch(tube, first, -1) in network.nodes[node].branches:
            start = _dead_end(network, tube, at_m, 1) if at is None else at
            network.edges.append(Edge(tube, at_m, first, start, node))
        at_m, at = last, node
    if at is None or Branch(tube, at_m, 1) in network.nodes[at].branches:
        start = _dead_end(network, tube, at_m, 1) if at is None else at
        length = network.tubes[tube].length_m
        network.edges.append(Edge(tube, at_m, length, start, _dead_end(network, tube, length, -1)))


def _dead_end(network: Network, tube: int, s_m: float, outward: int) -> int:
    position = network.tubes[tube].pose(s_m)[:3]
    network.nodes.append(Node("", position, (Branch(tube, s_m, outward),), 0.0))
    return len(network.nodes) - 1
