"""Navigation control under the orders of a mission's executive, as a process."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from lhdmap.errors import UsageError
from lhdmap.guidance.directive import Directive
from lhdmap.navigation.along import Located
from lhdmap.navigation.control import ARRIVED, ASSISTANCE, IDLE, NavigationControl
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    APPROACH,
    DIRECTIVE,
    LOADING,
    LOCATED,
    MACHINE_SAYS,
    MILLISECOND_NS,
    NAVIGATING,
    ORDERS,
    PLAN,
    STATION_SAYS,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.executive import HAS_THE_MACHINE
from lhdmap.replay.processes.feed import MOTION_TOPICS, MotionFeed
from lhdmap.replay.processes.navigator import NAVIGATION
from lhdmap.replay.processes.told import Asked, Idle, LoadingNow, Navigating, Orders

_AUTONOMOUS = "autonomous"


class OrderedNavigation(Process):
    """Drives from where the machine is to what was ordered last; a directive each 100 ms.

    While a loading task runs, its directives go to that task, which lets them through until it has found its pile.
    """

    name, period_ns, latency_ns, priority = NAVIGATION, 100 * MILLISECOND_NS, 5 * MILLISECOND_NS, 20
    reads = (*MOTION_TOPICS, LOCATED, MACHINE_SAYS, PLAN, STATION_SAYS, ORDERS, LOADING)

    def __init__(self, control: NavigationControl, scribe: Scribe) -> None:
        self.control, self._scribe = control, scribe
        self._feed = MotionFeed()
        self._located: Located | None = None
        self._orders: Orders | None = None
        self._loading: LoadingNow | None = None
        self._number = 0  # of the order that it is at
        self._asked_on = self._away = False
        self._mode = ""

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give the directive of now and say how far the drive is."""
        for received in inbox:
            self._take(received)
        motion, located, orders = self._feed.motion, self._located, self._orders
        if motion is None or located is None or orders is None:
            return
        self._obey(now_ns, orders, located)
        directive = None
        if self._mode != _AUTONOMOUS:
            self._away = self.control.state not in (IDLE, ARRIVED, ASSISTANCE)
        elif orders.goal and not self._yields(orders):
            directive = self._directive(now_ns, located)
        loads = orders.loading > 0
        cause = f"assistance: {self.control.reason}" if self.control.state == ASSISTANCE else self.control.state
        yield Outgoing(APPROACH if loads else DIRECTIVE, Asked(now_ns, directive, cause))
        control = self.control
        left_m = straight_left_m(control.left_m, last_leg=control.on_last_leg)
        yield Outgoing(
            NAVIGATING, Navigating(now_ns, control.state, self._number, control.goal, control.reason, left_m)
        )

    def _yields(self, orders: Orders) -> bool:
        """Return whether the loading task has the machine: one that digs stands, and is not stuck on its way."""
        now = self._loading
        return now is not None and orders.loading == now.number > 0 and now.state in HAS_THE_MACHINE

    def _obey(self, now_ns: int, orders: Orders, located: Located) -> None:
        """Begin another drive; where the place is not known, wait for it, and ask for help after some time."""
        if orders.number == self._number or not orders.goal:
            return
        self._number = orders.number
        if not self.control.knows(located):
            self.control.wait_for_place(now_ns, orders.goal, located, loaded=orders.loaded)
            return
        try:
            self.control.go("", orders.goal, located, loaded=orders.loaded)
        except UsageError as error:
            self._scribe.event("refused", str(error))

    def _directive(self, now_ns: int, located: Located) -> Directive | None:
        """Return the directive of now; None where the machine is to stand."""
        motion = self._feed.motion
        if motion is None:
            return None
        if self.control.knows(located) and (self._away or self._asked_on):
            self.control.go_on(located, reopened=self._asked_on)
            self._away = self._asked_on = False
        return self.control.step(now_ns, motion, located)

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic == LOCATED:
            self._located = message
        elif topic == ORDERS:
            self._orders, self.control.allowed.free = message, message.free
        elif topic == LOADING:
            self._loading = message
        elif topic == MACHINE_SAYS:
            self._mode = message.mode
            self.control.allowed.may_move = message.armed and message.mode == _AUTONOMOUS
        elif topic == PLAN:
            self.control.allowed.sight_m = math.inf if isinstance(message, Idle) else message.speeds.sight_m
        elif topic == STATION_SAYS:
            self._asked_on = message.go_on
        else:
            self._feed.take(received)


def straight_left_m(left_m: float, *, last_leg: bool) -> float:
    """Return the way to the goal, infinite before the last leg: the machine looks elsewhere, what is ahead is not its pile."""
    return left_m if last_leg else math.inf
