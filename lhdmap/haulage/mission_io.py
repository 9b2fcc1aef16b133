"""What the executive of a mission is told each time, and what it asks for: plain values, no topic, no process."""

from __future__ import annotations

from typing import Literal, NamedTuple

from lhdmap.haulage.records import Cycle, Phase
from lhdmap.haulage.states import Event, State

Answer = Literal["", "go_on", "done", "abort"]
Motion = Literal["go", "to_end", "stop"]


class Buckets(NamedTuple):
    """A part of a mission: so many buckets from a draw point to a dump, by their names on the map."""

    load: str
    dump: str
    buckets: int = 1


class Navigation(NamedTuple):
    """What navigation says: its state, its goal, why.

    The states: `idle`, `driving`, `waiting`, `resting`, `backing`, `halted`, `arrived`, `assistance`.

    `waiting`: it stands before a node of the map that it may not enter yet.
    `missed`: it came to its goal, not within tolerance, and does not try again itself.
    """

    state: str = "idle"
    goal: str = ""
    reason: str = ""


class Report(NamedTuple):
    """What loading (or dumping) says of the task with this number: `busy`, `done`, `failed`, `assistance`; nothing: not begun.

    `mass_t`: of what is in the bucket; `fill`: by the payload that is wanted; `slip`: of the wheels, share; nan: not known.
    """

    task: int = 0
    state: Literal["", "busy", "done", "failed", "assistance"] = ""
    mass_t: float = float("nan")
    fill: float = float("nan")
    attempts: int = 0
    slip: float = float("nan")
    reason: str = ""


class MissionInput(NamedTuple):
    """All that counts at a moment.

    Attributes:
        now_ns: time of now.
        pose_map: x, y (m) and yaw (rad) in `map`; None where it is not known.
        node: name or id of the node of the map that the machine is in, by localization; on a site nothing.
        inside: names or ids of the nodes that any part of the machine is in, by localization; empty: not known.
        odometer_m: how far was driven since some beginning.
        navigation: what navigation says.
        loading, dumping: what the tasks say.
        permit: whether the next section is granted; None: nobody else is on the map.
        point_free: whether the point of work is granted; None: nobody else is on the map.
        obstacle: something stands in the way.
        estop: an emergency stop is pressed.
        closed: names or ids of closed nodes (on a site: `Edge.node`).
        orders: buckets that are asked for; they are counted once, by how many there are.
        abort: the station ends the mission.
        answer: what the operator says to an open request.
        service_due: fuel, or another service, is due; it is over once it is no longer.
        make_way: others can only go on if the machine is at home; its next bucket waits.
    """

    now_ns: int
    pose_map: tuple[float, float, float] | None = None
    node: str = ""
    odometer_m: float = 0.0
    navigation: Navigation = Navigation()
    loading: Report = Report()
    dumping: Report = Report()
    permit: bool | None = None
    point_free: bool | None = None
    obstacle: bool = False
    estop: bool = False
    closed: tuple[str, ...] = ()
    orders: tuple[Buckets, ...] = ()
    abort: bool = False
    answer: Answer = ""
    service_due: bool = False
    make_way: bool = False
    inside: frozenset[str] = frozenset()


class MissionOutput(NamedTuple):
    """What is asked of the others, and for the journal.

    Attributes:
        state: state of the machine (`lhdmap.haulage.states.State`).
        stage: of the paper's 13, 0 where it has none.
        phase: what the time of now counts as.
        goal: where navigation is to go; nothing: stand.
        loaded: whether something is in the bucket, for navigation.
        task: number of the task of now; loading and dumping are begun by a new one.
        begin: the task that is to run now: `load`, `dump`, `refuel`, or nothing (then a running one is to end).
        motion: `go`, `to_end` of the edge, `stop`.
        wants: name of the node (or edge of a site) that a permit is wanted for.
        gives_way: the next turn crosses the opposing lane.
        asks: what help is asked for.
        left: buckets still to be dumped, of all orders.
        place: name of where the machine is, for the journal.
        cause: why the phase of now is what it is; empty: nothing to say.
        events: events since the last time.
        cycle: a cycle that has just ended.
    """

    state: State
    stage: int
    phase: Phase
    goal: str
    loaded: bool
    task: int
    begin: Literal["", "load", "dump", "refuel"]
    motion: Motion
    wants: str
    gives_way: bool
    asks: str
    left: int
    place: str
    cause: str
    events: tuple[Event, ...] = ()
    cycle: Cycle | None = None
