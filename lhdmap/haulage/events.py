"""The event of a moment, from plain facts: safety first, then the station, then permits and ways, then what the task says."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.haulage.layout import CLOSABLE, Layout
from lhdmap.haulage.machine import NOWHERE, HaulageMachine, Status
from lhdmap.haulage.mission_io import MissionInput, Report
from lhdmap.haulage.places import Whereabouts
from lhdmap.haulage.states import MOVING, WORKS, Event, Permission, State


class Moment(NamedTuple):
    """An event, with the edge that it is about."""

    event: Event
    edge: int = NOWHERE


class Facts(NamedTuple):
    """What the executive knows beside its status: where it is, the number of the task that runs, whether buckets are ordered.

    `helped`: navigation asked for the help that is given now; it goes on of itself.
    """

    where: Whereabouts
    task: int
    ordered: bool
    helped: bool


def event_of(machine: HaulageMachine, at: Status, given: MissionInput, facts: Facts) -> Moment | None:
    """Return the next event of a moment, None where all of them have been taken."""
    safety = _permission(at, given)
    if safety is not None:
        return Moment(safety)
    if given.abort and at.state in WORKS:
        return Moment(Event.ABORT)
    return (
        _ways(machine.layout, at, given)
        or _begins(machine, at, given, facts)
        or _service(at, given)
        or _of_state(machine, at, given, facts)
    )


def _permission(at: Status, given: MissionInput) -> Event | None:
    """Return what changes the permission: the hardest that holds wins."""
    if given.estop:
        return None if at.permission == Permission.STOPPED else Event.ESTOP
    if at.permission == Permission.STOPPED:
        return Event.RESET
    if given.obstacle:
        return None if at.permission == Permission.BLOCKED else Event.OBSTACLE
    if at.permission == Permission.BLOCKED:
        return Event.GONE
    if given.permit is False:
        return Event.DENIED if at.permission == Permission.GO else None
    return Event.GRANTED if at.permission == Permission.WAIT else None


def _ways(layout: Layout, at: Status, given: MissionInput) -> Moment | None:
    """Return an edge that has been closed or opened since."""
    if not given.closed and not at.closed:
        return None
    names = {layout.ids.get(name, name) for name in given.closed}
    for k, edge in enumerate(layout.edges):
        shut, wanted = bool(at.closed >> k & 1), edge.kind in CLOSABLE and edge.node in names
        if shut != wanted:
            return Moment(Event.CLOSED if wanted else Event.OPENED, k)
    return None


def _begins(machine: HaulageMachine, at: Status, given: MissionInput, facts: Facts) -> Moment | None:
    if not facts.ordered or given.abort:
        return None
    if at.state == State.IDLE:
        return Moment(Event.DISPATCH)
    if at.state == State.ABORTED:
        return Moment(Event.DISPATCH, facts.where.edge_now(machine, at._replace(left=1)))
    return None


def _service(at: Status, given: MissionInput) -> Moment | None:
    due = given.service_due or given.make_way
    if due and not at.service and at.state in WORKS:
        return Moment(Event.SERVICE_DUE)
    return Moment(Event.SERVICED) if at.state == State.REFUEL and at.service and not due else None


def _of_state(machine: HaulageMachine, at: Status, given: MissionInput, facts: Facts) -> Moment | None:
    if at.state in MOVING:
        return _moving(machine, at, given, facts.where)
    if at.state == State.QUEUE:
        free = given.point_free is not False and at.permission == Permission.GO and _in_queue(machine, at, given)
        return Moment(Event.POINT_FREE) if free and machine.next_edge(at) is not None else None
    if at.state == State.LOAD and machine.working(at):
        return _task(given.loading, facts.task, Event.LOADED, Event.LOAD_FAILED)
    if at.state == State.DUMP and machine.working(at):
        return _task(given.dumping, facts.task, Event.DUMPED, Event.DUMP_STUCK)
    return _assisted(machine, at, given, facts) if at.state == State.ASSIST else None


def _in_queue(machine: HaulageMachine, at: Status, given: MissionInput) -> bool:
    """Return whether a machine is at its queue point: after a dock that it missed it has to come back first."""
    said = given.navigation
    return not at.tries or (said.state == "arrived" and said.goal == machine.layout.edges[at.edge].end)


def _moving(machine: HaulageMachine, at: Status, given: MissionInput, where: Whereabouts) -> Moment | None:
    said = given.navigation
    if said.state == "assistance":
        return Moment(Event.LOST if "place" in said.reason else Event.OBSTACLE_STAYS)
    if at.ended:
        return None
    if said.state == "missed" and at.state == State.DOCK:
        return Moment(Event.DOCK_MISSED)
    there = said.state == "arrived" and said.goal in (machine.goal(at), machine.layout.edges[at.edge].end)
    return Moment(Event.REACH) if there or where.crossed(machine, at) else None


def _task(report: Report, task: int, done: Event, failed: Event) -> Moment | None:
    """Return the event of a report, if it is about the task of now."""
    if report.task != task:
        return None
    return {"done": Moment(done), "failed": Moment(failed)}.get(report.state)


def _assisted(machine: HaulageMachine, at: Status, given: MissionInput, facts: Facts) -> Moment | None:
    if given.answer == "abort":
        return Moment(Event.ABORT)
    if at.permission == Permission.STOPPED:
        return None
    if given.answer == "done":
        return Moment(Event.COMPLETED)
    asks = given.navigation.state == "assistance"
    on = (given.answer == "go_on" or facts.helped) and not asks
    return Moment(Event.ASSISTED, facts.where.edge_now(machine, at)) if on else None
