"""What goes over the link between a machine and the console: typed messages, one JSON object each, docs/console.md."""

from __future__ import annotations

from typing import NamedTuple

PROTOCOL = 1
ANSWER, REARM, STOP = "answer", "rearm", "stop"
COMMANDS = (ANSWER, REARM, STOP)
Points = tuple[tuple[float, float], ...]
Pose = tuple[float, float, float]


class Hello(NamedTuple):
    """First message of a machine: its name and the version of these messages."""

    machine: str
    protocol: int = PROTOCOL


class Plan(NamedTuple):
    """Lines to draw the machine on, and points by name; metres, in the frame of its poses."""

    frame: str
    lines_m: tuple[Points, ...]
    places: tuple[tuple[str, float, float], ...] = ()


class Status(NamedTuple):
    """What a machine is and does now: `pose` (x, y in metres, heading in rad) in the frame of the plan, None: not known."""

    time_s: float
    armed: bool
    mode: str
    standing: bool
    causes: tuple[str, ...] = ()
    mission: str = ""
    doing: str = ""
    pose: Pose | None = None


class Ask(NamedTuple):
    """A request for help with its evidence: values by name; `cloud_m` hits and `pile_m` toe of the pile in `base_link`."""

    number: int
    kind: str
    during: str
    why: str
    asks: str
    tried: tuple[str, ...] = ()
    evidence: tuple[tuple[str, str], ...] = ()
    cloud_m: Points = ()
    pile_m: Points = ()


class Asked(NamedTuple):
    """The open request; None: there is none any more."""

    request: Ask | None


class Event(NamedTuple):
    """Something that happened on a machine."""

    time_s: float
    process: str
    text: str
    grave: bool = False


class Tick(NamedTuple):
    """A machine wants a sign of life: the page of who operates it answers with the number. `round_trip_s`: of the last answer."""

    number: int
    round_trip_s: float
    limit_s: float


class Outcome(NamedTuple):
    """What became of a command: taken, or why not."""

    command: str
    taken: bool
    why: str = ""


class Beat(NamedTuple):
    """Sign of life of the operator's page: the number of the tick that it answers."""

    number: int
    by: str


class Command(NamedTuple):
    """What an operator wants of a machine; `audit`: hash of its line in the console's audit file."""

    id: str
    kind: str
    number: int = 0
    answer: str = ""
    by: str = ""
    cause: str = ""
    audit: str = ""


MACHINE_SAYS = (Hello, Plan, Status, Asked, Event, Tick, Outcome)
CONSOLE_SAYS = (Beat, Command)
Message = Hello | Plan | Status | Asked | Event | Tick | Outcome | Beat | Command
