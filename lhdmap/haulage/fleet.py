"""Several missions on one layout under section control: `Fleet.update({machine: MissionInput}) -> {machine: MissionOutput}`.

A section is what edges of the same name (`Edge.held`: their node, or what it was joined to) lie in. Each machine asks for the next
one while it is in its own; what is granted becomes its `permit`, or frees its point. A machine that can only be let home is told
to make way.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import groupby, pairwise

from lhdmap.errors import UsageError
from lhdmap.haulage.layout import Layout, nodes_of_section
from lhdmap.haulage.machine import NOWHERE, Errand, Status
from lhdmap.haulage.mission import MissionTask
from lhdmap.haulage.mission_io import MissionInput, MissionOutput
from lhdmap.haulage.settings import HaulageSettings
from lhdmap.haulage.states import MOVING, TASKS, Permission, State
from lhdmap.traffic.control import TrafficControl
from lhdmap.traffic.sections import Haul, Leg, Section, SectionMap


class Fleet:
    """Machines by name, each with its errand (its orders are to be from and to the same points) and a park of its own.

    `machine_m`: length of a machine; where it is not told what it is in (`inside`), its rear has left a section once it is so
    far beyond.
    """

    def __init__(
        self,
        layout: Layout,
        errands: Mapping[str, Errand],
        settings: HaulageSettings | None = None,
        machine_m: float = 10.0,
    ) -> None:
        self._layout, self._settings, self._machine_m = layout, settings or HaulageSettings(), machine_m
        tries = self._settings.tries
        self.tasks = {name: MissionTask(layout, name, errand.park, tries) for name, errand in errands.items()}
        hauls = {name: Haul(*(self._section_at(point) for point in errand)) for name, errand in errands.items()}
        self.control = TrafficControl(sections_of_layout(layout, errands), hauls)
        self._entered: dict[str, tuple[str, float]] = {}

    def update(self, given: Mapping[str, MissionInput]) -> dict[str, MissionOutput]:
        """Return what is asked of each machine; one that is not told of is left alone, with the sections that it holds."""
        for name, told in given.items():
            self._asks(name, told)
        self.control.step(max((told.now_ns for told in given.values()), default=0))
        outputs = {}
        for name, told in given.items():
            free, way = self._free(name, told), self._makes_way(name)
            outputs[name] = self.tasks[name].update(told._replace(permit=free, point_free=free, make_way=way))
        return outputs

    def member(self, name: str) -> Member:
        """Return one machine as a task of its own."""
        return Member(self, name)

    def nodes_of(self, name: str) -> frozenset[str]:
        """Return the nodes (ids of the map, or names) of the sections that a machine holds."""
        nodes = self._nodes_in({section for section, by in self.control.held().items() if by == name})
        return frozenset(nodes | {one for one, named in self._layout.ids.items() if named in nodes})

    def _nodes_in(self, sections: Collection[str]) -> set[str]:
        """Return the names of the nodes of sections."""
        joined = {node for section in sections for node in nodes_of_section(section)}
        return joined | {edge.node for edge in self._layout.edges if edge.held in sections}

    def bound(self, name: str) -> str:
        """Return where a machine is bound for, whatever it waits for; empty: it is to stand."""
        task = self.tasks[name]
        at = task.status
        moves = at.state in MOVING | {State.QUEUE} and at.permission in (Permission.GO, Permission.WAIT)
        return task.machine.goal(at) if moves else ""

    def _section_at(self, point: str) -> str:
        return self._layout.edges[self._layout.entering[point][0]].held

    def _asks(self, name: str, told: MissionInput) -> None:
        """Let a machine give back what is behind it, and ask for what comes next."""
        task = self.tasks[name]
        if task.status.edge == NOWHERE:
            return
        here, granted = self._layout.edges[task.status.edge].held, self.control.place(name).section
        if here != granted:
            return  # it has what comes next, and is not there yet
        if self._out(name, here, told):
            self.control.left(name)
        following = self._next_section(name, told)
        if following:
            status = task.status
            home = not status.left and not status.loaded and not told.orders[task.orders_taken :]
            self.control.wants(name, told.now_ns, following, home=home or told.service_due)

    def _out(self, name: str, here: str, told: MissionInput) -> bool:
        """Return whether a machine has left the section behind: by where it is, else by the way since it entered its own."""
        if told.inside:
            behind = self._nodes_in({self.control.behind(name)})
            return behind.isdisjoint(self._layout.ids.get(one, one) for one in told.inside)
        at, entered_m = self._entered.get(name, ("", 0.0))
        if at != here:
            self._entered[name] = (here, told.odometer_m)
        return at == here and told.odometer_m - entered_m >= self._machine_m

    def _bound(self, name: str, told: MissionInput) -> Status:
        """Return the status with which a machine goes on: of a parked one that of its next order."""
        task = self.tasks[name]
        status = task.status
        if status.state == State.IDLE and told.orders[task.orders_taken :]:
            return status._replace(left=1)
        return status._replace(service=True) if self._makes_way(name) else status

    def _next_section(self, name: str, told: MissionInput) -> str:
        """Return the section after the one that a machine is in; empty: none is wanted yet."""
        task, ahead = self.tasks[name], self._bound(name, told)
        if (ahead.state in TASKS and task.machine.working(ahead)) or task.to_go_m > self._settings.ask_m:
            return ""
        here = self._layout.edges[ahead.edge].held
        for _ in range(len(self._layout.edges)):
            following = task.machine.next_edge(ahead)
            if following is None:
                return ""
            if self._layout.edges[following].held != here:
                return self._layout.edges[following].held
            ahead = ahead._replace(edge=following)
        return ""

    def _free(self, name: str, told: MissionInput) -> bool:
        """Return whether a machine may drive into what comes next."""
        bound = self._bound(name, told)
        if bound.edge == NOWHERE:
            return False
        here, granted = self._layout.edges[bound.edge].held, self.control.place(name).section
        following = self.tasks[name].machine.next_edge(bound)
        return following is not None and self._layout.edges[following].held in (
            {here} if here == granted else {here, granted}
        )

    def _makes_way(self, name: str) -> bool:
        """Return whether a machine with more to load has been let home alone: its next bucket waits until it is there."""
        place, task = self.control.place(name), self.tasks[name]
        haul = self.control.haul(name)
        bound = place.leg == Leg.HOME and place.section not in (haul.dump, haul.home)
        return bound and task.status.left > 0 and not task.status.loaded


class Member:
    """One machine of a fleet with what a `MissionTask` offers; its goal stays while it waits: navigation holds by `free`."""

    def __init__(self, fleet: Fleet, name: str) -> None:
        self._fleet, self._name = fleet, name

    @property
    def free(self) -> frozenset[str]:
        """Nodes that the machine may be in."""
        return self._fleet.nodes_of(self._name)

    def update(self, given: MissionInput) -> MissionOutput:
        """Return what is asked of this machine now."""
        out = self._fleet.update({self._name: given})[self._name]
        return out._replace(goal=self._fleet.bound(self._name) or out.goal)


def sections_of_layout(layout: Layout, errands: Mapping[str, Errand]) -> SectionMap:
    """Return the sections of the ways between the points of errands: of edges with the same name, linked as they are driven.

    Raises:
        UsageError: an errand has no way.
    """
    lengths: dict[str, float] = {}
    links: dict[tuple[str, str], None] = {}
    for name, errand in errands.items():
        for start, goal in (
            (errand.park, errand.load), (errand.load, errand.dump), (errand.dump, errand.load), (errand.dump, errand.park),
        ):  # fmt: skip
            route = layout.route(start, goal)
            if route is None:
                raise UsageError(f"machine '{name}': no way from {start} to {goal}")
            edges = [layout.edges[layout.entering[start][0]], *(layout.edges[k] for k in route)]
            for edge in edges:
                lengths[edge.held] = max(lengths.get(edge.held, 0.0), edge.length_m)
            links |= dict.fromkeys(pairwise(name for name, _ in groupby(edges, key=lambda edge: edge.held)))
    return SectionMap(tuple(Section(name, length) for name, length in lengths.items()), tuple(links))
