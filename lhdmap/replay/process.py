"""What a process of a replay is, what it gets and what it gives; topics that are not the contract's."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

TRUTH = "/ground_truth/"
"""Topics that begin like this are the simulator's: nobody who could be on a machine gets them."""
STATE = f"{TRUTH}state"
"""The machine's true state (`VehicleState`), at each step of it."""
CONTACT = f"{TRUTH}contact"
"""What the machine touches, and how near it comes to what it does not (`Nearness`)."""
MISSION = "/operation/mission"
"""How far the drive is (`Text`): `driving`, `done`, `assistance: …`, `aborted: …`."""
POSE = "/perception/pose"
"""Where perception believes the machine is, in its own frame (`PoseNow`)."""
SEEN = "/perception/hits"
"""Hits of the newest processed scan (`Seen`)."""
LOCATED = "/localization/place"
"""Where the machine is on the map (`Located` of navigation)."""
DIRECTIVE = "/navigation/directive"
"""What navigation asks of guidance (`Asked`)."""
PILE = "/perception/pile"
"""Each new estimate of the pile ahead, in perception's frame (`Snapshot`)."""
PEDALS = "/loading/pedals"
"""What the loading task asks of the pedals (`Digs`)."""
LOADING = "/loading/state"
"""What the loading task does, and the help that it asks for (`LoadingNow`)."""
ORDERS = "/mission/orders"
"""What the executive of a mission asks of navigation, loading and dumping (`Orders`)."""
NAVIGATING = "/navigation/state"
"""How far navigation is with what was ordered (`Navigating`)."""
APPROACH = "/navigation/approach"
"""What navigation asks for while the loading task looks for its pile (`Asked`)."""
DUMPING = "/dumping/state"
"""How far dumping is (`DumpingNow`)."""
CYCLE = "/mission/cycle"
"""A bucket that has been dumped, with what its time went into (`Cycle`)."""
SITE_POSE = "/site/pose"
"""Where a machine of a surface site is, as its receiver tells (`WheelPose` in `map`)."""
WAY = "/site/way"
"""Which edges of a site are driven now, in which gear (`WayNow`)."""
WORK = "/site/work"
"""How far a timed task of loading or dumping is (`WorkNow`)."""
PLAN = "/guidance/plan"
"""Setpoints of the next seconds (`Plan`)."""
STATION_SAYS = "/station/says"
"""What the operator's station says (`Word`): sign of life, modes, re-arming, emergency stop, joystick."""
MACHINE_SAYS = "/machine/says"
"""What the machine tells the station (`Health`)."""
EVERYTHING = "*"
MACHINE, STATION, EVERYWHERE = "machine", "station", ""
"""Where a process is. What goes from the machine to the station crosses the link; a witness is everywhere."""
ENGINE = "engine"
MILLISECOND_NS = 1_000_000


class Outgoing(NamedTuple):
    """A message that a process gives; it appears at `at_ns`, or the process's latency after its turn."""

    topic: str
    message: Any
    at_ns: int | None = None


class Received(NamedTuple):
    """A message that a process gets: its topic, when it was sent, what it says."""

    topic: str
    sent_ns: int
    message: Any


class Process(ABC):
    """Something that has a turn each `period_ns`, takes what has come, and gives messages.

    Attributes:
        name: unlike that of all others.
        period_ns: time between turns.
        latency_ns: how long a turn takes; its messages appear then, and turns that come before that are missed.
        priority: of those that have their turns at the same time, the lowest is first.
        reads: topics that it gets, `*` for all.
        inbox_size: how many messages wait at most; the oldest go first.
        site: where it is.
    """

    name: str
    period_ns: int
    latency_ns: int = 0
    priority: int = 50
    reads: tuple[str, ...] = ()
    inbox_size: int = 1000
    site: str = MACHINE

    @abstractmethod
    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterable[Outgoing]:
        """Have a turn: take all that has come since the last one, return what is to be sent."""

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:  # noqa: B027  # most have nothing to finish
        """Take what has come after the last turn; the run has ended."""
