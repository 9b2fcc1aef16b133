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
from lhdmap.movement.rules import STANDING_ALONG, STATE_COUNT
from lhdmap.movement.search import Searcher
from lhdmap.movement.ways import arms_of, known_connections
from lhdmap.topology.model import DEAD_END, AccessPoint, Connection, Intersection, TopologicalMap, Waypoint

Labels = npt.NDArray[np.int32]
_FACES = ("draw_point", "dump")
_SHOWN = 5


class Reach:
    """What a machine that stands somewhere in the largest connected part of a map can reach, and from where it comes back.

    `labels` (P, 2): the strongly connected part that standing along or against each point's heading belongs to. `main`: that with
    the most nodes in it. `reached`, `returns` (P, 2): from it, and to it.
    """

    def __init__(self, planner: RoutePlanner) -> None:
        movement, topology = planner.movement, planner.topology
        edges = movement.edges
        graph = csr_matrix(
            (np.ones(len(edges.to)), edges.to, edges.first), shape=(movement.state_count,) * 2, copy=True
        )
        graph.sum_duplicates()  # with parallel edges SciPy's search for strong components does not end
        labels = connected_components(graph, connection="strong")[1].reshape(-1, STATE_COUNT)
        self.labels: Labels = labels[:, STANDING_ALONG:]
        self._points: dict[str, list[int]] = {}
        parts: dict[int, set[str]] = {}
        for k, point in enumerate(topology.points.values()):
            self._points.setdefault(point.node, []).append(k)
            for label in self.labels[k]:
                parts.setdefault(int(label), set()).add(point.node)
        self.main = max(parts, key=lambda label: len(parts[label]))
        inside = np.argwhere(self.labels == self.main)
        sources = inside[:, 0] * STATE_COUNT + STANDING_ALONG + inside[:, 1]
        count = len(planner.ways.start)
        self.reached = self._standing(Searcher(edges, count).distances(sources))
        self.returns = self._standing(Searcher(movement.backward, count).distances(sources))
        self.sources = sources

    def of(self, node: str) -> npt.NDArray[np.int64]:
        """Return the points (indices) of a node."""
        return np.array(self._points.get(node, []), dtype=np.int64)

    @staticmethod
    def _standing(costs: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        finite: npt.NDArray[np.bool_] = np.isfinite(costs.reshape(-1, STATE_COUNT)[:, STANDING_ALONG:])
        return finite


def reach_findings(planner: RoutePlanner, reach: Reach) -> Iterator[Finding]:
    """Yield nodes and waypoints that cannot be reached from the others, or not be left again."""
    topology = planner.topology
    index = {name: k for k, name in enumerate(topology.points)}
    shut = {one.id for one in topology.tunnels if one.closed}
    for node in topology.nodes.values():
        points = reach.of(node.id)
        if not len(points):
            yield Finding("error", "reach", node.name, "has no access point: nothing leads there")
        elif node.id in shut:
            continue
        elif not reach.reached[points].any():
            yield _unreached(planner, reach, node.id, node.name)
        elif not (reach.returns | ~reach.reached)[points].all():
            yield Finding("error", "inversion", node.name, "can be entered with a heading in which it cannot be left")
    for one in topology.waypoints:
        if not reach.reached[index[one.id]].any() and reach.reached[reach.of(one.node)].any():
            yield _unreached(planner, reach, one.id, one.name)


def _unreached(planner: RoutePlanner, reach: Reach, name: str, shown: str) -> Finding:
    nowhere = np.zeros(len(planner.ways.start), bool)
    goal = place(planner.topology, name, None)
    found = planner.sequence(reach.sources, goal, tolls_of_all(planner.ways, nowhere), everywhere=True)
    text = "nothing joins it to them"
    if found is not None:
        blocks = blocks_on(planner.topology, planner.ways, found, nowhere)
        text = "in the way: " + ", ".join(f"{one.start}:{one.end} ({one.why})" for one in blocks)
    return Finding("error", "reach", shown, f"cannot be reached from the other nodes; {text}")


def inversion_findings(topology: TopologicalMap, reach: Reach, machine: Machine) -> Iterator[Finding]:
    """Yield missing inversions: arms of an intersection that not even one joins, dead ends too short for one, missing turns."""
    inside: dict[str, list[Connection]] = {}
    for way in known_connections(topology):
        inside.setdefault(topology.points[way.start].node, []).append(way)
    shut = arms_of(topology, {one.id for one in topology.tunnels if one.closed})
    for node in topology.intersections:
        yield from _arm_findings(topology, node, reach, inside.get(node.id, []), shut)
    length_m = machine.dimensions.length_m
    worked = {one.node for one in topology.waypoints if one.purpose in _FACES}
    for tunnel in topology.tunnels:
        if DEAD_END in tunnel.ends and tunnel.length_m < length_m and tunnel.id not in worked:
            text = f"a dead end of {tunnel.length_m:.1f} m: a machine of {length_m:g} m that changes gear in it"
            yield Finding("warning", "inversion", tunnel.name, f"{text} still stands in the intersection")
    yield from _heading_findings(topology, reach)
    yield from _face_findings(topology, reach)


def _heading_findings(topology: TopologicalMap, reach: Reach) -> Iterator[Finding]:
    """Yield the nodes in which the machine always heads the same way, however it is driven: it cannot be turned on the map."""
    fixed = []
    for name, node in topology.nodes.items():
        inside = reach.labels[reach.of(name)] == reach.main
        if inside.any() and not inside.all(axis=1).any():
            fixed.append(node.name)
    if fixed:
        names = ", ".join(fixed[:_SHOWN]) + (" …" if len(fixed) > _SHOWN else "")
        text = f"{len(fixed)} of {len(topology.nodes)} nodes can be driven in one heading only"
        yield Finding("note", "heading", names, f"{text}: the machine cannot be turned for them")


def _arm_findings(
    topology: TopologicalMap, node: Intersection, reach: Reach, ways: list[Connection], shut: set[str]
) -> Iterator[Finding]:
    """Yield pairs of arms without a free way from one to the other: by an inversion in a third arm, or not at all.

    `shut`: arms into closed tunnels, of which nothing is wanted.
    """
    free = {frozenset((one.start, one.end)) for one in ways if one.feasible and not one.closed}
    why = {frozenset((one.start, one.end)): one.reason or ("closed" if one.closed else "too sharp") for one in ways}
    points = list(topology.points.values())
    arms = [points[k].id for k in reach.of(node.id) if isinstance(points[k], AccessPoint) and points[k].id not in shut]
    for a, b in combinations(arms, 2):
        pair = frozenset((a, b))
        if pair in free:
            continue
        reason = why.get(pair, "no connection")
        by = [c for c in arms if c not in pair and {frozenset((a, c)), frozenset((c, b))} <= free]
        if by:
            yield Finding("note", "infeasible", f"{a}:{b}", f"{reason}; an inversion at {by[0]} takes its place")
        else:
            text = f"{reason}, and no inversion at {node.name} takes its place"
            yield Finding("warning", "inversion", f"{a}:{b}", text)


def _face_findings(topology: TopologicalMap, reach: Reach) -> Iterator[Finding]:
    """Yield draw points and dumps in dead ends that a machine cannot come to bucket first which comes so to the first of them."""
    index = {name: k for k, name in enumerate(topology.points)}
    labels = [(one, _face_label(topology, reach, index, one)) for one in topology.waypoints if one.purpose in _FACES]
    faces = [(one, label) for one, label in labels if label is not None]
    for one, label in faces[1:]:
        if label != faces[0][1]:
            text = f"a machine that stands bucket first at {faces[0][0].name} cannot come here bucket first"
            yield Finding("error", "inversion", one.name, f"{text}: a place to turn is missing")


def _face_label(topology: TopologicalMap, reach: Reach, index: dict[str, int], one: Waypoint) -> int | None:
    """Return the part of the map in which the machine stands bucket first at a face.

    None where no dead end tells which way that is, or nothing leads there.
    """
    points = list(topology.points.values())
    entries = [points[k] for k in reach.of(one.node) if getattr(points[k], "joins", None) is not None]
    if len(entries) != 1 or not reach.reached[index[one.id]].any():
        return None
    inward = one.pose[:2] - entries[0].pose[:2]
    along = float(inward @ [np.cos(one.pose[3]), np.sin(one.pose[3])]) >= 0.0
    return int(reach.labels[index[one.id], 0 if along else 1])
