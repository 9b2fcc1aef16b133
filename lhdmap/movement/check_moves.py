"""Checks of a map by its movements: what can be reached and left, and where the machine can be turned or inverted."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from lhdmap.machine import Machine
from lhdmap.movement.blocks import blocks_on, tolls_of_all
from lhdmap.movement.findings import Finding
from lhdmap.movement.places import place
from lhdmap.movement.routes import RoutePlanner
from lhdmap.movement.rules import STANDING_AGAINST, STANDING_ALONG, STATE_COUNT
from lhdmap.movement.search import Searcher
from lhdmap.topology.model import DEAD_END, Intersection, TopologicalMap, Waypoint

Labels = npt.NDArray[np.int32]
_FACES = ("draw_point", "dump")


class Reach:
    """What a machine that stands somewhere in the largest connected part of a map can reach, and from where it comes back.

    `labels` (P, 2): the strongly connected part that standing along or against each point's heading belongs to. `main`: that with
    the most nodes in it. `reached`, `returns` (P, 2): from it, and to it.
    """

    def __init__(self, planner: RoutePlanner) -> None:
        movement, topology = planner.movement, planner.topology
        edges = movement.edges
        graph = csr_matrix((np.ones(len(edges.to)), edges.to, edges.first), shape=(movement.state_count,) * 2)
        labels = connected_components(graph, connection="strong")[1].reshape(-1, STATE_COUNT)
        self.labels: Labels = labels[:, STANDING_ALONG:]
        self.nodes = [one.node for one in topology.points.values()]
        parts: dict[int, set[str]] = {}
        for k, node in enumerate(self.nodes):
            for label in self.labels[k]:
                parts.setdefault(int(label), set()).add(node)
        self.main = max(parts, key=lambda label: len(parts[label]))
        inside = np.argwhere(self.labels == self.main)
        sources = inside[:, 0] * STATE_COUNT + STANDING_ALONG + inside[:, 1]
        count = len(planner.ways.start)
        self.reached = self._standing(Searcher(edges, count).distances(sources))
        self.returns = self._standing(Searcher(movement.backward, count).distances(sources))
        self.sources = sources

    def of(self, node: str) -> npt.NDArray[np.int64]:
        """Return the points (indices) of a node."""
        return np.flatnonzero(np.array(self.nodes) == node)

    @staticmethod
    def _standing(costs: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        finite: npt.NDArray[np.bool_] = np.isfinite(costs.reshape(-1, STATE_COUNT)[:, STANDING_ALONG:])
        return finite


def reach_findings(planner: RoutePlanner, reach: Reach) -> Iterator[Finding]:
    """Yield nodes that cannot be reached from the others, or not be left again."""
    topology = planner.topology
    for node in topology.nodes.values():
        points = reach.of(node.id)
        if not len(points):
            yield Finding("error", "reach", node.name, "has no access point: nothing leads there")
        elif not reach.reached[points].any():
            yield Finding(
                "error",
                "reach",
                node.name,
                f"cannot be reached from the other nodes{_blocked(planner, reach, node.id)}",
            )
        elif not (reach.returns | ~reach.reached)[points].all():
            yield Finding("error", "inversion", node.name, "can be entered with a heading in which it cannot be left")


def _blocked(planner: RoutePlanner, reach: Reach, node: str) -> str:
    nowhere = np.zeros(len(planner.ways.start), bool)
    goal = place(planner.topology, node, None)
    found = planner.sequence(reach.sources, goal, tolls_of_all(planner.ways, nowhere), everywhere=True)
    if found is None:
        return ": nothing joins it to them"
    blocks = blocks_on(planner.topology, planner.ways, found, nowhere)
    return "; in the way: " + ", ".join(f"{one.start}:{one.end} ({one.why})" for one in blocks)


def inversion_findings(topology: TopologicalMap, reach: Reach, machine: Machine) -> Iterator[Finding]:
    """Yield missing inversions: arms of an intersection that not even one joins, dead ends too short for one, missing turns."""
    for node in topology.intersections:
        yield from _arm_findings(topology, node)
    length_m = machine.dimensions.length_m
    for tunnel in topology.tunnels:
        if DEAD_END in tunnel.ends and tunnel.length_m < length_m:
            text = f"a dead end of {tunnel.length_m:.1f} m: the machine of {length_m:g} m that changes gear in it stands in the intersection"
            yield Finding("warning", "inversion", tunnel.name, text)
    yield from _face_findings(topology, reach)
    one_way = [
        name
        for name, node in topology.nodes.items()
        if len(points := reach.of(name)) and not (reach.labels[points] == reach.main).all(axis=1).any() and node.name
    ]
    if one_way:
        names = ", ".join(topology.nodes[name].name for name in one_way[:5]) + (" …" if len(one_way) > 5 else "")
        text = f"{len(one_way)} of {len(topology.nodes)} nodes can be driven in one heading only: nowhere can the machine be turned for them"
        yield Finding("note", "heading", names, text)


def _arm_findings(topology: TopologicalMap, node: Intersection) -> Iterator[Finding]:
    """Yield pairs of arms without a free way from one to the other: by an inversion in a third arm, or not at all."""
    ways = [one for one in topology.connections if {one.start, one.end} <= topology.points.keys()]
    ways = [one for one in ways if topology.points[one.start].node == node.id]
    free = {frozenset((one.start, one.end)) for one in ways if one.feasible and not one.closed}
    why = {frozenset((one.start, one.end)): one.reason or ("closed" if one.closed else "too sharp") for one in ways}
    arms = [one.id for one in topology.points_of(node.id)]
    for a, b in combinations(arms, 2):
        pair = frozenset((a, b))
        if pair in free:
            continue
        reason = why.get(pair, "no connection")
        by = [c for c in arms if c not in pair and {frozenset((a, c)), frozenset((c, b))} <= free]
        if by:
            yield Finding("note", "infeasible", f"{a}:{b}", f"{reason}; an inversion at {by[0]} takes its place")
        else:
            yield Finding(
                "warning", "inversion", f"{a}:{b}", f"{reason}, and no inversion at {node.name} takes its place"
            )


def _face_findings(topology: TopologicalMap, reach: Reach) -> Iterator[Finding]:
    """Yield draw points and dumps in dead ends that the machine cannot come to bucket first, coming so from the first of them."""
    index = {name: k for k, name in enumerate(topology.points)}
    faces = [
        (one, label) for one in topology.waypoints if (label := _face_label(topology, reach, index, one)) is not None
    ]
    for one, label in faces[1:]:
        if label != faces[0][1]:
            text = f"a machine that stands bucket first at {faces[0][0].name} cannot come here bucket first: a turning bay is missing"
            yield Finding("error", "inversion", one.name, text)


def _face_label(topology: TopologicalMap, reach: Reach, index: dict[str, int], one: Waypoint) -> int | None:
    """Return the part of the map in which the machine stands bucket first at a face; None where it is not told which way that is."""
    tunnel = next((tunnel for tunnel in topology.tunnels if tunnel.id == one.node), None)
    entries = [point for point in topology.access_points if point.node == one.node and point.joins is not None]
    if one.purpose not in _FACES or tunnel is None or len(entries) != 1:
        return None
    inward = one.pose[:2] - entries[0].pose[:2]
    along = float(inward @ [np.cos(one.pose[3]), np.sin(one.pose[3])]) >= 0.0
    column = (STANDING_ALONG if along else STANDING_AGAINST) - STANDING_ALONG
    return int(reach.labels[index[one.id], column])
