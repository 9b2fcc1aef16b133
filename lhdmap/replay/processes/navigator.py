"""Navigation control as a process."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lhdmap.messages import Text
from lhdmap.navigation.along import Located
from lhdmap.navigation.control import ARRIVED, ASSISTANCE, IDLE, NavigationControl
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    DIRECTIVE,
    LOCATED,
    MACHINE_SAYS,
    MILLISECOND_NS,
    MISSION,
    PLAN,
    STATION_SAYS,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.feed import MOTION_TOPICS, MotionFeed
from lhdmap.replay.processes.told import Asked, Idle

NAVIGATION = "navigation"
_SETTLED_NS = 1_000_000_000
_MOVES = ("autonomous", "assisted")


class Errand(NamedTuple):
    """A drive from a place of the map, empty: from where the machine is, to another."""

    start: str
    goal: str
    loaded: bool


class Navigator(Process):
    """Plans once the place is known and the machine is armed; then a directive each 100 ms."""

    name, period_ns, latency_ns, priority = NAVIGATION, 100 * MILLISECOND_NS, 5 * MILLISECOND_NS, 20
    reads = (*MOTION_TOPICS, LOCATED, MACHINE_SAYS, PLAN, STATION_SAYS)

    def __init__(self, control: NavigationControl, errand: Errand, scribe: Scribe) -> None:
        self.control, self._errand, self._scribe = control, errand, scribe
        self._feed = MotionFeed()
        self._located: Located | None = None
        self._mission = ""
        self._asked_on = False
        self._since_ns: int | None = None

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give the directive of now and say how far the drive is."""
        for received in inbox:
            self._take(received)
        motion, located = self._feed.motion, self._located
        if motion is None or located is None:
            return
        if self.control.state == IDLE:
            self._begin(now_ns, located)
        if self._asked_on:
            self._asked_on = False
            self._go_on(located)
        directive = self.control.step(now_ns, motion, located)
        yield Outgoing(DIRECTIVE, Asked(now_ns, directive, self.control.state))
        mission = self._told()
        if mission != self._mission:
            self._mission = mission
            self._scribe.event("mission", mission)
            yield Outgoing(MISSION, Text(now_ns, mission))

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic == LOCATED:
            self._located = message
        elif topic == MACHINE_SAYS:
            self.control.may_move = message.armed and message.mode in _MOVES
        elif topic == PLAN:
            self.control.sight_m = math.inf if isinstance(message, Idle) else message.speeds.sight_m
        elif topic == STATION_SAYS:
            self._asked_on = self._asked_on or message.go_on
        else:
            self._feed.take(received)

    def _begin(self, now_ns: int, located: Located) -> None:
        """Go, once the place has held for a second."""
        if located.status != "tracking":
            self._since_ns = None
            return
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        if now_ns - self._since_ns >= _SETTLED_NS:
            errand = self._errand
            self.control.go(errand.start, errand.goal, located, loaded=errand.loaded)

    def _go_on(self, located: Located) -> None:
        """Go on after help, where the place is known; a drive that could not begin begins."""
        if self.control.knows(located):
            self.control.go_on(located)

    def _told(self) -> str:
        state = self.control.state
        if state == ARRIVED:
            return "done"
        return f"assistance: {self.control.reason}" if state == ASSISTANCE else "driving"
