"""Navigation control as a process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lhdmap.messages import Text
from lhdmap.navigation.control import ARRIVED, ASSISTANCE, IDLE, Located, NavigationControl
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    DIRECTIVE,
    LOCATED,
    MACHINE_SAYS,
    MILLISECOND_NS,
    MISSION,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.feed import MOTION_TOPICS, MotionFeed
from lhdmap.replay.processes.told import Asked

NAVIGATION = "navigation"
_SETTLED_NS = 1_000_000_000
_MOVES = ("autonomous", "assisted")


class Errand(NamedTuple):
    """A drive from a place of the map to another."""

    start: str
    goal: str
    loaded: bool


class Navigator(Process):
    """Plans once the place is known and the machine is armed; then a directive each 100 ms."""

    name, period_ns, latency_ns, priority = NAVIGATION, 100 * MILLISECOND_NS, 5 * MILLISECOND_NS, 20
    reads = (*MOTION_TOPICS, LOCATED, MACHINE_SAYS)

    def __init__(self, control: NavigationControl, errand: Errand, scribe: Scribe) -> None:
        self.control, self._errand, self._scribe = control, errand, scribe
        self._feed = MotionFeed()
        self._located: Located | None = None
        self._mission = ""
        self._since_ns: int | None = None

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give the directive of now and say how far the drive is."""
        for received in inbox:
            if received.topic == LOCATED:
                self._located = received.message
            elif received.topic == MACHINE_SAYS:
                self.control.may_move = received.message.armed and received.message.mode in _MOVES
            else:
                self._feed.take(received)
        motion, located = self._feed.motion, self._located
        if motion is None or located is None:
            return
        if self.control.state == IDLE:
            self._begin(now_ns, located)
        directive = self.control.step(now_ns, motion, located)
        yield Outgoing(DIRECTIVE, Asked(now_ns, directive, self.control.state))
        mission = self._told()
        if mission != self._mission:
            self._mission = mission
            self._scribe.event("mission", mission)
            yield Outgoing(MISSION, Text(now_ns, mission))

    def _begin(self, now_ns: int, located: Located) -> None:
        """Go, once the place has held for a second."""
        if located.status != "tracking":
            self._since_ns = None
            return
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        if now_ns - self._since_ns >= _SETTLED_NS:
            errand = self._errand
            self.control.go(errand.start, errand.goal, located, loaded=errand.loaded)

    def _told(self) -> str:
        state = self.control.state
        if state == ARRIVED:
            return "done"
        return f"assistance: {self.control.reason}" if state == ASSISTANCE else "driving"
