"""Navigation control as a process."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import SPEED, Directive
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
from lhdmap.replay.processes.told import Asked, Idle, Word

NAVIGATION = "navigation"
_SETTLED_NS = 1_000_000_000
_FOUND_NS = 10_000_000_000  # a place that is found among all takes some scans
_MOVES = ("autonomous", "assisted")
_CREEPS_MPS = 0.1


class Errand(NamedTuple):
    """A drive from a place of the map, empty: from where the machine is, to another."""

    start: str
    goal: str
    loaded: bool


class _Station:
    """What the station last said: to go on, that it gives up, another goal, the speed of an operator."""

    def __init__(self) -> None:
        self.asked_on = False
        self.gave_up = self.goal = ""
        self.speed_mps = 0.0

    def take(self, word: Word) -> None:
        """Take a word; a goal holds until another one is named."""
        self.asked_on, self.gave_up = word.go_on, word.gave_up
        self.goal = word.goal or self.goal
        self.speed_mps = abs(word.speed_mps or 0.0)


class Navigator(Process):
    """Plans once the place is known and the machine is armed; then a directive each 100 ms.

    `errand`: where to; None: what the executive of a mission orders.
    """

    name, period_ns, latency_ns, priority = NAVIGATION, 100 * MILLISECOND_NS, 5 * MILLISECOND_NS, 20
    reads = (*MOTION_TOPICS, LOCATED, MACHINE_SAYS, PLAN, STATION_SAYS)

    def __init__(self, control: NavigationControl, errand: Errand, scribe: Scribe) -> None:
        self.control, self._errand, self._scribe = control, errand, scribe
        self._feed = MotionFeed()
        self._located: Located | None = None
        self._station = _Station()
        self._mission = self._mode = ""
        self._away = False
        self._since_ns: int | None = None
        self._idle_ns: int | None = None  # since when it wants to begin

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give the directive of now and say how far the drive is."""
        for received in inbox:
            self._take(received)
        motion, located = self._feed.motion, self._located
        if motion is None or located is None:
            return
        directive = self._directive(now_ns, motion, located)
        mission = self._told()
        cause = mission if self.control.state == ASSISTANCE else self.control.state
        yield Outgoing(DIRECTIVE, Asked(now_ns, directive, cause))
        if mission != self._mission:
            self._mission = mission
            self._scribe.event("mission", mission)
            yield Outgoing(MISSION, Text(now_ns, mission))

    def _directive(self, now_ns: int, motion: Motion, located: Located) -> Directive | None:
        """Return the directive of now; None where the machine is to stand, or others drive it."""
        control = self.control
        if self._mode not in _MOVES:
            self._away = control.state not in (IDLE, ARRIVED, ASSISTANCE)
            return None
        if control.state == IDLE:
            self._begin(now_ns, located)
        elif control.knows(located) and (self._away or self._station.asked_on):
            control.go_on(located, reopened=self._station.asked_on)
            self._away = self._station.asked_on = False
        elif self._station.goal not in ("", control.goal) and control.knows(located):
            control.go("", self._station.goal, located, loaded=self._errand.loaded)
        directive = control.step(now_ns, motion, located)
        return directive if self._mode == "autonomous" else _no_faster(directive, self._station.speed_mps)

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic == LOCATED:
            self._located = message
        elif topic == MACHINE_SAYS:
            self._mode = message.mode
            waits = message.mode == "assisted" and self._station.speed_mps < _CREEPS_MPS
            self.control.allowed.may_move = message.armed and message.mode in _MOVES and not waits
        elif topic == PLAN:
            self.control.allowed.sight_m = math.inf if isinstance(message, Idle) else message.speeds.sight_m
        elif topic == STATION_SAYS:
            self._station.take(message)
        else:
            self._feed.take(received)

    def _begin(self, now_ns: int, located: Located) -> None:
        """Go, once the place has held for a second; where it does not for long, let navigation ask for help."""
        errand = self._errand
        self._idle_ns = now_ns if self._idle_ns is None else self._idle_ns
        if located.status != "tracking":
            self._since_ns = None
            if now_ns - self._idle_ns >= _FOUND_NS:
                self.control.wait_for_place(now_ns, errand.goal, located, loaded=errand.loaded)
            return
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        if now_ns - self._since_ns >= _SETTLED_NS:
            self.control.go(errand.start, errand.goal, located, loaded=errand.loaded)

    def _told(self) -> str:
        state = self.control.state
        if self._station.gave_up:
            return f"aborted: {self._station.gave_up}"
        if state == ARRIVED:
            return "done"
        return f"assistance: {self.control.reason}" if state == ASSISTANCE else "driving"


def _no_faster(directive: Directive | None, speed_mps: float) -> Directive | None:
    """Return a directive at an operator's speed; None where he wants to stand."""
    if directive is None or speed_mps < _CREEPS_MPS:
        return None
    path = directive.path.copy()
    path[:, SPEED] = np.minimum(path[:, SPEED], speed_mps)
    return directive._replace(path=path)
