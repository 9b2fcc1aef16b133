"""What the state machine runs on: points, and directed edges between them, each of a kind. Made of a site or of a map."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.haulage.states import FOLLOWS, State
from lhdmap.messages import FloatArray

Purpose = Literal["", "load", "dump", "park", "queue"]
CLOSABLE = (State.ROAD, State.AREA_IN, State.DOCK)
"""Kinds of edges that can be closed; who is behind them comes out all the same."""
GOALS = ("load", "dump", "park")


class Point(NamedTuple):
    """Where edges end. `area`: that it lies in, empty on the road."""

    name: str
    purpose: Purpose = ""
    area: str = ""


class Edge(NamedTuple):
    """A way from a point to another. `line_m` (N, 2+): its path; `gives_way`: its turn crosses the opposing lane.

    `node`: what the map calls the place that it lies in; `section`: of traffic, empty: the node is one; `reverse_from_m`: from
    there on in reverse (a dock), inf: never.
    """

    start: str
    end: str
    kind: State
    length_m: float
    area: str = ""
    node: str = ""
    gives_way: bool = False
    line_m: FloatArray | None = None
    speed_kmh: float = 0.0
    reverse_from_m: float = np.inf
    section: str = ""

    @property
    def held(self) -> str:
        """What one machine holds at a time to be on it."""
        return self.section or self.node


def nodes_of_section(section: str) -> list[str]:
    """Return the names of the nodes that a section was joined of; of some no edge is known: stubs in which machines turn."""
    return section.split("+")


@dataclass(frozen=True)
class Layout:
    """Points and edges; `roles`: what is done in each area (`load`, `dump`, …); `ids`: names of nodes by the map's ids.

    `aprons`: corners (N, 2) of the ground of areas, where they are known.
    """

    name: str
    points: tuple[Point, ...]
    edges: tuple[Edge, ...]
    roles: dict[str, str] = field(default_factory=dict)
    ids: dict[str, str] = field(default_factory=dict)
    aprons: dict[str, FloatArray] = field(default_factory=dict)

    @cached_property
    def point(self) -> dict[str, Point]:
        """Points by name."""
        return {one.name: one for one in self.points}

    @cached_property
    def leaving(self) -> dict[str, list[int]]:
        """Numbers of the edges that leave each point, in their order."""
        return {one.name: [k for k, edge in enumerate(self.edges) if edge.start == one.name] for one in self.points}

    @cached_property
    def entering(self) -> dict[str, list[int]]:
        """Numbers of the edges that come to each point."""
        return {one.name: [k for k, edge in enumerate(self.edges) if edge.end == one.name] for one in self.points}

    @cached_property
    def passages(self) -> list[int]:
        """The edges that close together with each edge, as bits: those of its tunnel, but no way out of it, nor junctions."""
        bits: dict[str, int] = {}
        for k, edge in enumerate(self.edges):
            if edge.kind in CLOSABLE:
                bits[edge.node] = bits.get(edge.node, 0) | 1 << k
        return [bits[edge.node] if edge.kind in CLOSABLE and edge.node else 1 << k for k, edge in enumerate(self.edges)]

    def of(self, purpose: str) -> list[str]:
        """Return the points of a purpose."""
        return [one.name for one in self.points if one.purpose == purpose]

    def first_edges(self, goal: str, closed: Iterable[int] = ()) -> dict[str, int]:
        """Return, of each point from which `goal` can be reached, the edge that the shortest way there begins with.

        Ways lead through no other load point, dump or park: who is at work there is not driven through.
        """
        shut, cost_m, first = set(closed), {goal: 0.0}, {}
        queue: list[tuple[float, str]] = [(0.0, goal)]
        while queue:
            cost, point = heapq.heappop(queue)
            if cost > cost_m[point] or (point != goal and self.point[point].purpose in GOALS):
                continue
            for k in self.entering[point]:
                edge = self.edges[k]
                through = cost + max(edge.length_m, 0.01)
                if k not in shut and through < cost_m.get(edge.start, np.inf):
                    cost_m[edge.start], first[edge.start] = through, k
                    heapq.heappush(queue, (through, edge.start))
        return first

    def route(self, start: str, goal: str, closed: Iterable[int] = ()) -> list[int] | None:
        """Return the edges of the shortest way, None where there is none."""
        first, found, point = self.first_edges(goal, closed), [], start
        while point != goal:
            if point not in first:
                return None
            found.append(first[point])
            point = self.edges[first[point]].end
        return found


def faults_of(layout: Layout) -> Iterator[str]:
    """Yield what a machine would come to grief over: one that has begun could not finish, or would not know what to do."""
    for purpose in GOALS:
        if not layout.of(purpose):
            yield f"no point of purpose '{purpose}'"
    for edge in layout.edges:
        for name in {edge.start, edge.end} - set(layout.point):
            yield f"edge {edge.start} to {edge.end}: there is no point '{name}'"
    if any(name not in layout.point for edge in layout.edges for name in (edge.start, edge.end)):
        return
    yield from _wrong_order(layout)
    yield from _queues_without_exit(layout)
    yield from _stranded(layout)


def _wrong_order(layout: Layout) -> Iterator[str]:
    for edge in layout.edges:
        docks = layout.point[edge.end].purpose in GOALS
        if docks != (edge.kind == State.DOCK):
            wanted = "an edge to a load point, dump or park, and no other, is of kind 'dock'"
            yield f"edge {edge.start} to {edge.end} is of kind '{edge.kind}': {wanted}"
        for k in layout.leaving[edge.end]:
            follower = layout.edges[k]
            if follower.kind not in FOLLOWS[edge.kind]:
                yield f"{edge.end}: an edge '{follower.kind}' follows one '{edge.kind}'"


def _queues_without_exit(layout: Layout) -> Iterator[str]:
    for one in layout.points:
        kinds = [layout.edges[k].kind for k in layout.leaving[one.name]]
        if State.DOCK in kinds and set(kinds) == {State.DOCK}:
            docks = ", ".join(layout.edges[k].end for k in layout.leaving[one.name])
            yield (
                f"{one.name}: the queue point has no exit that does not lead through {docks}; a machine that may not go in "
                f"(point closed, service due, aborted) could never leave. Add a way out of {one.name}"
            )


def _stranded(layout: Layout) -> Iterator[str]:
    for purpose in GOALS:
        for goal in layout.of(purpose):
            first = layout.first_edges(goal)
            cut = sorted({edge.end for edge in layout.edges} - set(first) - {goal})
            if cut:
                shown = ", ".join(cut[:4]) + (" …" if len(cut) > 4 else "")
                yield f"{goal} ({purpose}) cannot be reached from {shown} without passing another point of work"


def checked(layout: Layout) -> Layout:
    """Return the layout.

    Raises:
        InputError: a machine could be stranded in it; the text names each place and what is missing.
    """
    faults = list(dict.fromkeys(faults_of(layout)))
    if faults:
        more = f" (and {len(faults) - 5} more)" if len(faults) > 5 else ""
        raise InputError(f"layout '{layout.name}' cannot be run on: {'; '.join(faults[:5])}{more}")
    return layout
