"""The executive of a mission: buckets from draw points to dumps, as goals of navigation and tasks of loading and dumping.

`MissionTask.update(MissionInput) -> MissionOutput`, as often as wanted; time is an input. Each time the events of the moment are
derived (`lhdmap.haulage.events`), the state machine takes them, and what it is at tells what is asked of the others.
"""

from __future__ import annotations

from typing import Literal

from lhdmap.haulage.events import Facts, Moment, event_of
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.machine import NOWHERE, Errand, HaulageMachine, Status, Tries
from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput, Motion, Report
from lhdmap.haulage.phases import phase_of
from lhdmap.haulage.places import Whereabouts
from lhdmap.haulage.records import Cycle, Interval, Ledger
from lhdmap.haulage.stages import stage_of
from lhdmap.haulage.states import MOVING, Event, Permission, State

_MOST_EVENTS = 64  # at a moment
_TASKS: dict[State, Literal["load", "dump", "refuel"]] = {
    State.LOAD: "load", State.DUMP: "dump", State.REFUEL: "refuel",
}  # fmt: skip


class MissionTask:
    """Runs on one layout; `park`: where the machine stands at first, and goes when nothing is left (empty: the first one)."""

    def __init__(self, layout: Layout, machine: str = "lhd", park: str = "", tries: Tries | None = None) -> None:
        self._name, self._tries = machine, tries
        self._park = park or layout.of("park")[0]
        first = Errand(layout.of("load")[0], layout.of("dump")[0], self._park)
        self.machine = HaulageMachine(layout, first, tries)
        self.status: Status = self.machine.idle()
        self._where = Whereabouts(layout)
        self._ledger = Ledger()
        self._orders: list[Buckets] = []
        self.orders_taken = self._task = self._number = 0
        self._helped = False
        self._bucket = Report()
        self._cycle: Cycle | None = None

    def update(self, given: MissionInput) -> MissionOutput:
        """Return what is asked for now."""
        self._orders += given.orders[self.orders_taken :]
        self.orders_taken = max(self.orders_taken, len(given.orders))
        events: list[Event] = []
        self._cycle = None
        self._where.moved(given)
        while len(events) < _MOST_EVENTS and (moment := self._moment(given)) is not None:
            before = self.status.edge
            self._take(moment, given)
            events.append(moment.event)
            if self.status.edge != before and given.permit is not None:
                given = given._replace(permit=False, point_free=False)  # what was granted has been used
        phase, cause = phase_of(self.machine, self.status, given, first=self._number == 0)
        self._ledger.note(given.now_ns, phase, self._where.place(self.status), cause, given.odometer_m)
        return self._output(given, tuple(events))

    @property
    def to_go_m(self) -> float:
        """Way to the end of the edge that the machine is on; 0 where it is not known, and where it stands at the end."""
        return self._where.to_go_m

    def rest(self) -> Cycle | None:
        """Return what has been done since the last cycle ended, as a cycle that was not finished; None: nothing."""
        intervals = self._ledger.take()
        return self._made(intervals, finished=False) if intervals else None

    def _moment(self, given: MissionInput) -> Moment | None:
        return event_of(
            self.machine, self.status, given, Facts(self._where, self._task, bool(self._orders), self._helped)
        )

    def _take(self, moment: Moment, given: MissionInput) -> None:
        """Let the machine take an event, and note what it means."""
        before, event = self.status, moment.event
        if event == Event.DISPATCH:
            self._next_errand()
        buckets = self._orders.pop(0).buckets if event == Event.DISPATCH else 1
        if event == Event.DUMPED and before.left == 1 and self._orders:
            self._next_errand()
            before = before._replace(left=1 + self._orders.pop(0).buckets)
        self.status = self.machine.step(before, event, moment.edge, buckets)
        if self.status.loaded and not before.loaded:
            self._bucket = given.loading
        if self.status.state == State.ASSIST and before.state != State.ASSIST:
            self._helped = event in (Event.LOST, Event.OBSTACLE_STAYS)
        if event == Event.ABORT:
            self._orders.clear()
        again = event in (Event.LOAD_FAILED, Event.DUMP_STUCK)
        if self.status.state in _TASKS and (self.status.state != before.state or again):
            self._task += 1
        if before.loaded and not self.status.loaded:
            self._end_cycle(given)
        if (self.status.edge, self.status.ended) != (before.edge, before.ended) or event == Event.DOCK_MISSED:
            self._where.begins(self.status, before)

    def _next_errand(self) -> None:
        order = self._orders[0]
        self.machine = HaulageMachine(self.machine.layout, Errand(order.load, order.dump, self._park), self._tries)

    def _end_cycle(self, given: MissionInput) -> None:
        """Close the cycle whose bucket has just been dumped."""
        phase, cause = phase_of(self.machine, self.status, given, first=False)
        self._ledger.note(given.now_ns, phase, self._where.place(self.status), cause, given.odometer_m)
        self._cycle = self._made(self._ledger.take(), finished=True)
        self._number += 1

    def _made(self, intervals: tuple[Interval, ...], *, finished: bool) -> Cycle:
        errand, told = self.machine.errand, self._bucket
        self._bucket = Report()
        measured = (told.mass_t, told.fill, told.attempts, told.slip)
        return Cycle(self._name, self._number + 1, errand.load, errand.dump, intervals, *measured, finished)

    def _output(self, given: MissionInput, events: tuple[Event, ...]) -> MissionOutput:
        at = self.status
        phase, cause = phase_of(self.machine, at, given, first=self._number == 0)
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
            self._cycle,
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
