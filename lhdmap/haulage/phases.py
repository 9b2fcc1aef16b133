"""What the time of now counts as."""

from __future__ import annotations

from lhdmap.haulage.machine import HaulageMachine, Status
from lhdmap.haulage.mission_io import MissionInput
from lhdmap.haulage.records import Phase
from lhdmap.haulage.states import MOVING, TASKS, Permission, State

_TASKS = {State.LOAD: Phase.LOAD, State.DUMP: Phase.DUMP, State.REFUEL: Phase.REFUEL}
_ALONE = {State.IDLE: Phase.IDLE, State.ABORTED: Phase.ABORTED, State.ASSIST: Phase.ASSISTANCE}


def phase_of(machine: HaulageMachine, at: Status, given: MissionInput, *, first: bool) -> tuple[Phase, str]:
    """Return the phase and its cause; `first`: no bucket has been dumped yet, so the way to the draw point is no return."""
    if at.state in _ALONE:
        return _ALONE[at.state], given.navigation.reason if at.state == State.ASSIST else ""
    if at.permission == Permission.STOPPED:
        return Phase.STOPPED, "emergency stop"
    if at.permission == Permission.BLOCKED:
        return Phase.OBSTACLE, given.navigation.reason or "something stands in the way"
    if at.state in TASKS and machine.working(at):
        return _task(at, given)
    if at.state == State.QUEUE:
        return (Phase.QUEUE_DUMP if at.loaded else Phase.QUEUE_LOAD), "the point is not granted"
    if at.state in TASKS or at.ended:
        none = machine.next_edge(at) is None
        return (
            (Phase.NO_ROUTE, "no open way to the goal") if none else (Phase.TRAFFIC, "no permit for the next section")
        )
    return _drive(at, given, first=first)


def _task(at: Status, given: MissionInput) -> tuple[Phase, str]:
    if at.state == State.REFUEL and given.make_way and not given.service_due:
        return Phase.TRAFFIC, "makes way for others"
    report = given.loading if at.state == State.LOAD else given.dumping
    helped = at.state != State.REFUEL and report.state == "assistance"
    return (Phase.ASSISTANCE, report.reason) if helped else (_TASKS[at.state], "")


def _drive(at: Status, given: MissionInput, *, first: bool) -> tuple[Phase, str]:
    said = given.navigation
    if at.state in MOVING and said.state == "idle":
        return Phase.ROUTE, "navigation has no route yet"
    if said.state == "waiting":
        return Phase.TRAFFIC, "no permit for the next section"
    if said.state == "halted":
        return Phase.PLACE, said.reason or "place not known"
    if at.loaded:
        return Phase.HAUL, ""
    if not at.left or at.service:
        return Phase.PARK, ""
    return (Phase.TRAM if first else Phase.RETURN), ""
