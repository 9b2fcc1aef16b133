"""The executive of a mission: buckets from draw points to dumps, as goals of navigation and tasks of loading and dumping.

`MissionTask.update(MissionInput) -> MissionOutput`, as often as wanted; time is an input. Each time the events of the moment are
derived (`lhdmap.haulage.events`), the state machine takes them, and what it is at tells what is asked of the others.
"""

from __future__ import annotations

from typing import Literal

from lhdmap.errors import UsageError
from lhdmap.haulage.book import Book
from lhdmap.haulage.events import Facts, Moment, event_of
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.machine import NOWHERE, Errand, HaulageMachine, Status, Tries
from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput, Motion
from lhdmap.haulage.phases import phase_of
from lhdmap.haulage.places import Whereabouts
from lhdmap.haulage.records import Cycle, Phase
from lhdmap.haulage.stages import stage_of
from lhdmap.haulage.states import MOVING, Event, Permission, State
from lhdmap.settings import nearest

_MOST_EVENTS = 64  # at a moment
_TASKS: dict[State, Literal["load", "dump", "refuel"]] = {
    State.LOAD: "load", State.DUMP: "dump", State.REFUEL: "refuel",
}  # fmt: skip


class MissionTask:
    """Runs on one layout; `park`: where the machine stands at first, and goes when nothing is left (empty: the first one)."""

    def __init__(self, layout: Layout, machine: str = "lhd", park: str = "", tries: Tries | None = None) -> None:
        self._tries = tries
        self._park = park or layout.of("park")[0]
        first = Errand(layout.of("load")[0], layout.of("dump")[0], self._park)
        self.machine = HaulageMachine(layout, first, tries)
        self.status: Status = self.machine.idle()
        self._where, self._book = Whereabouts(layout), Book(machine)
        self._orders: list[Buckets] = []
        self.orders_taken = self._task = 0
        self._helped = False

    def update(self, given: MissionInput) -> MissionOutput:
        """Return what is asked for now.

        Raises:
            UsageError: an order names what is no draw point or no dump of the layout.
        """
        self._orders += [self._checked(one) for one in given.orders[self.orders_taken :]]
        self.orders_taken = max(self.orders_taken, len(given.orders))
        events: list[Event] = []
        self._book.ended = None
        self._where.moved(given)
        while len(events) < _MOST_EVENTS and (moment := self._moment(given)) is not None:
            before = self.status.edge
            self._take(moment, given)
            events.append(moment.event)
            if self.status.edge != before and given.permit is not None:
                given = given._replace(permit=False, point_free=False)  # what was granted has been used
        self._note(given)
        return self._output(given, tuple(events))

    @property
    def to_go_m(self) -> float:
        """Way to the end of the edge that the machine is on; 0 where it is not known, and where it stands at the end."""
        return self._where.to_go_m

    def rest(self) -> Cycle | None:
        """Return what has been done since the last cycle ended, as a cycle that was not finished; None: nothing."""
        return self._book.rest(self.machine.errand)

    def _checked(self, order: Buckets) -> Buckets:
        for name, purpose in ((order.load, "load"), (order.dump, "dump")):
            known = self.machine.layout.of(purpose)
            if name not in known:
                raise UsageError(f"'{name}' is no point to {purpose}{nearest(name, known)}")
        return order

    def _moment(self, given: MissionInput) -> Moment | None:
        facts = Facts(self._where, self._task, bool(self._orders), self._helped)
        return event_of(self.machine, self.status, given, facts)

    def _take(self, moment: Moment, given: MissionInput) -> None:
        """Let the machine take an event, and note what it means."""
        before, event, errand = self.status, moment.event, self.machine.errand
        buckets = self._next_errand() if event == Event.DISPATCH else 1
        if event == Event.DUMPED and before.left == 1 and self._orders:
            before = before._replace(left=1 + self._next_errand())
        self.status = self.machine.step(before, event, moment.edge, buckets)
        if self.status.loaded and not before.loaded:
            self._book.loaded(given.loading)
        if self.status.state == State.ASSIST and before.state != State.ASSIST:
            self._helped = event in (Event.LOST, Event.OBSTACLE_STAYS)
        if event == Event.ABORT:
            self._orders.clear()
        again = event in (Event.LOAD_FAILED, Event.DUMP_STUCK)
        if self.status.state in _TASKS and (self.status.state != before.state or again):
            self._task += 1
        if before.loaded and not self.status.loaded:
            self._note(given)
            self._book.dumped(errand)
        if (self.status.edge, self.status.ended) != (before.edge, before.ended) or event == Event.DOCK_MISSED:
            self._where.begins(self.status, before)

    def _next_errand(self) -> int:
        """Take up the next order, return its buckets."""
        order = self._orders.pop(0)
        self.machine = HaulageMachine(self.machine.layout, Errand(order.load, order.dump, self._park), self._tries)
        return order.buckets

    def _note(self, given: MissionInput) -> None:
        phase, cause = self._phase(given)
        self._book.ledger.note(given.now_ns, phase, self._where.place(self.status), cause, given.odometer_m)

    def _phase(self, given: MissionInput) -> tuple[Phase, str]:
        first = self._book.cycles == 0 and self._book.ended is None
        return phase_of(self.machine, self.status, given, first=first)

    def _output(self, given: MissionInput, events: tuple[Event, ...]) -> MissionOutput:
        at = self.status
        phase, cause = self._phase(given)
        working = at.state in _TASKS and self.machine.working(at)
        following = self._where.following(self.machine, at)
        edges = self.machine.layout.edges
        return MissionOutput(
            at.state,
            stage_of(at.state, loaded=at.loaded),
            phase,
            self._goal(at),
            at.loaded,
            self._task,
            _TASKS[at.state] if working else "",
            _motion(at),
            "" if following is None else edges[following].node,
            following is not None and edges[following].gives_way,
            cause if at.state == State.ASSIST else "",
            at.left + sum(one.buckets for one in self._orders),
            self._where.place(at),
            cause,
            events,
            self._book.ended,
        )

    def _goal(self, at: Status) -> str:
        """Return where navigation is to go: to the goal, or as far as is permitted; with its own help it keeps its goal."""
        if at.state == State.ASSIST:
            return self.machine.goal(at) if self._helped else ""
        if at.state not in MOVING | {State.QUEUE} or _motion(at) == "stop":
            return ""
        if at.edge != NOWHERE and (at.permission == Permission.WAIT or at.state == State.QUEUE):
            return self.machine.layout.edges[at.edge].end
        return self.machine.goal(at)


def _motion(at: Status) -> Motion:
    if at.permission in (Permission.BLOCKED, Permission.STOPPED) or at.state not in MOVING:
        return (
            "stop" if at.state != State.QUEUE or at.permission in (Permission.BLOCKED, Permission.STOPPED) else "to_end"
        )
    return "to_end" if at.ended or at.permission == Permission.WAIT else "go"
