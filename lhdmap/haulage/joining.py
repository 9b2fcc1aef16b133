"""Sections that machines as long as they are can hold: nodes of a map, joined where one alone would not do.

An intersection and the arm in which a machine changes gear there are one section: it is in both while it does. A section that a
machine would be through before its rear is out of the one behind is joined to the next one on the way, as it would wait for ever.
Sections of draw points, dumps and parks stay alone: others have to pass them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from lhdmap.errors import UsageError
from lhdmap.haulage.layout import Edge, Layout, nodes_of_section
from lhdmap.haulage.machine import Errand
from lhdmap.navigation.hold import beyond_of
from lhdmap.navigation.leg import Leg
from lhdmap.topology.model import TopologicalMap

Drives = Mapping[tuple[str, str], Sequence[Leg]]
"""Legs that navigation drives, by where from and where to."""


def with_sections(
    layout: Layout, topology: TopologicalMap, errands: Mapping[str, Errand], drives: Drives, least_m: float
) -> Layout:
    """Return the layout with the sections of its edges named; `least_m`: shorter ones are joined to the next on a way.

    Raises:
        UsageError: machines would have to change gear where another one works, or a short section has no next one.
    """
    works = {layout.edges[layout.entering[point][0]].node for errand in errands.values() for point in errand}
    joined = _Joined(works, layout.ids)
    for (start, goal), legs in drives.items():
        for leg in legs:
            arm = beyond_of(topology, leg) if leg.inversion else ""
            if arm:
                joined.join(leg.targets[-1].node, arm, f"from {start} to {goal} machines change gear")
    for (start, goal), legs in drives.items():
        turns = {leg.targets[-1].node for leg in legs if leg.inversion}
        _join_short(joined, _edges(layout, start, goal), least_m, {layout.ids.get(one, one) for one in turns})
    return replace(layout, edges=tuple(edge._replace(section=joined.name(edge.node)) for edge in layout.edges))


def ways_of(errand: Errand) -> list[tuple[str, str]]:
    """Return where a machine drives from and to on its errand."""
    return [
        (errand.park, errand.load),
        (errand.load, errand.dump),
        (errand.dump, errand.load),
        (errand.dump, errand.park),
    ]


def check_pull_back(layout: Layout, errands: Mapping[str, Errand], room_m: float) -> None:
    """Check that a machine that has pulled back from its pile by `room_m`, its length with it, reaches into nobody's section.

    Raises:
        UsageError: the draw point's section is shorter, and another machine drives through the one behind it.
    """
    for name, errand in errands.items():
        edge = layout.edges[layout.entering[errand.load][0]]
        behind = [one.held for one in _edges(layout, errand.load, errand.dump) if one.held != edge.held][:1]
        others = [ways_of(one) for other, one in errands.items() if other != name]
        used = {one.held for ways in others for way in ways for one in _edges(layout, *way)}
        if edge.length_m < room_m and used.intersection(behind):
            raise UsageError(
                f"draw point {errand.load}: its section {edge.held} has {edge.length_m:.1f} m behind it, a machine that "
                f"pulls back into {behind[0]} needs {room_m:.1f} m: sections cannot be held"
            )


def _edges(layout: Layout, start: str, goal: str) -> list[Edge]:
    route = layout.route(start, goal)
    if route is None:
        raise UsageError(f"no way leads from {start} to {goal}")
    return [layout.edges[layout.entering[start][0]], *(layout.edges[k] for k in route)]


def _join_short(joined: _Joined, edges: Sequence[Edge], least_m: float, turns: Collection[str]) -> None:
    """Join what is too short between two others on a way; the first and the last section of a way are not driven through.

    `turns`: nodes (names) at which machines change gear on this way: they are wholly in the arm's section then, however short
    the way through it.
    """

    def turned(section: str) -> bool:
        return not set(turns).isdisjoint(nodes_of_section(section))

    while True:
        parts = [
            (name, sum(edge.length_m for edge in group))
            for name, group in groupby(edges, key=lambda edge: joined.name(edge.node))
        ]
        short = next(
            (k for k, part in enumerate(parts[1:-1], start=1) if part[1] < least_m and not turned(part[0])), None
        )
        if short is None:
            return
        name = parts[short][0]
        others = [parts[k][0] for k in (short + 1, short - 1) if not joined.works_in(parts[k][0])]
        if not others:
            around = f"{parts[short - 1][0]} and {parts[short + 1][0]}"
            raise UsageError(f"section {name} between {around} is shorter than a machine needs ({least_m:.0f} m)")
        joined.join_named(name, others[0])


class _Joined:
    """Which nodes are one section; a section has the names of its nodes."""

    def __init__(self, works: set[str], names: Mapping[str, str]) -> None:
        self._works, self._names = works, names
        self._parts: dict[str, tuple[str, ...]] = {}

    def name(self, node: str) -> str:
        """Return the name of the section of a node, by the node's name."""
        return "+".join(self._parts.get(node, (node,)))

    def works_in(self, section: str) -> bool:
        """Return whether a machine loads, dumps or parks in a section."""
        return not self._works.isdisjoint(nodes_of_section(section))

    def join(self, node: str, other: str, why: str) -> None:
        """Make two nodes (ids) one section."""
        pair = [self._names.get(one, one) for one in (node, other)]
        shut = self._works.intersection(pair)
        if shut:
            raise UsageError(
                f"{why} in {' and '.join(sorted(shut))}, where another one may stand: sections cannot be held"
            )
        self.join_named(*pair)

    def join_named(self, node: str, other: str) -> None:
        """Make one section of the sections that two names begin with."""
        ones = [self._parts.get(name.split("+")[0], (name.split("+")[0],)) for name in (node, other)]
        whole = tuple(dict.fromkeys([*ones[0], *ones[1]]))
        self._parts |= dict.fromkeys(whole, whole)
