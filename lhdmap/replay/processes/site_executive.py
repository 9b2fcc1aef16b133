"""The executive of a mission on a surface site: loads from an area to another, by orders to the driver and to those who load."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput, Navigation, Report
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    MACHINE_SAYS,
    MILLISECOND_NS,
    NAVIGATING,
    SITE_POSE,
    STATION_SAYS,
    WORK,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.executive import EXECUTIVE
from lhdmap.replay.processes.order_book import OrderBook, Task
from lhdmap.replay.processes.site_driver import BLOCKED
from lhdmap.replay.processes.told import Health, Navigating, Orders, WorkNow

_MODE = "autonomous"
_STEP_M = 0.5  # of the odometer: less is noise of the pose


class SiteExecutive(Process):
    """Each 100 ms the mission task is told what is, and its outputs become orders.

    The station hears what help is asked for, and answers; after a `go on` the drive is begun anew from where the machine is.
    """

    name, period_ns, latency_ns, priority = EXECUTIVE, 100 * MILLISECOND_NS, 5 * MILLISECOND_NS, 15
    reads = (SITE_POSE, NAVIGATING, WORK, STATION_SAYS)

    def __init__(self, task: Task, orders: Sequence[Buckets], full_t: float, scribe: Scribe) -> None:
        self.task, self._buckets, self._full_t, self._book = task, tuple(orders), full_t, OrderBook(scribe)
        self._pose: tuple[float, float, float] | None = None
        self._counted_m, self._odometer_m = (math.nan, math.nan), 0.0
        self._navigating: Navigating | None = None
        self._work: WorkNow | None = None
        self._orders, self._key = Orders(0, 0, "", loaded=False), ("", False)
        self._go_on = self._gave_up = False

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give orders, and each cycle that has ended."""
        for received in inbox:
            self._take(received)
        if self._pose is None:
            return
        out = self.task.update(self._told(now_ns))
        if self._go_on and out.asks:
            self._key = ("", out.loaded)
        self._go_on = False
        self._orders = self._ordered(now_ns, out)
        yield from self._book.say(now_ns, out, self._orders, self._odometer_m)
        yield Outgoing(MACHINE_SAYS, Health(now_ns, True, _MODE, bool(out.asks), (), out.asks))

    def _told(self, now_ns: int) -> MissionInput:
        told, orders, work = self._navigating, self._orders, self._work
        navigation = Navigation()
        blocked = told is not None and told.state == BLOCKED
        if told is not None and told.number == orders.number and not blocked:
            navigation = Navigation(told.state, told.goal, told.reason)
        loading = dumping = Report()
        if work is not None and work.task in (orders.loading, orders.dumping):
            state: str = "done" if work.state == "done" else "busy"
            report = Report(
                work.task, "done" if state == "done" else "busy", work.mass_t, work.mass_t / self._full_t, 1
            )
            loading, dumping = (report, Report()) if orders.loading else (Report(), report)
        return MissionInput(
            now_ns,
            pose_map=self._pose,
            odometer_m=self._odometer_m,
            navigation=navigation,
            loading=loading,
            dumping=dumping,
            obstacle=blocked,
            orders=self._buckets,
            abort=self._gave_up,
            answer="go_on" if self._go_on else "",
        )

    def _ordered(self, now_ns: int, out: MissionOutput) -> Orders:
        """Return the orders that follow from what the mission task asks; another goal, or the same one anew, is another drive."""
        key = out.goal, out.loaded
        number = self._orders.number + (bool(out.goal) and key != self._key)
        if out.goal:
            self._key = key
        elif out.begin:
            self._key = ("", out.loaded)
        loading, dumping = (out.task if out.begin == one else 0 for one in ("load", "dump"))
        return Orders(now_ns, number, out.goal, out.loaded, loading, dumping)

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic == STATION_SAYS:
            self._go_on |= bool(message.go_on)
            self._gave_up |= bool(message.gave_up)
        elif topic == NAVIGATING:
            self._navigating = message
        elif topic == WORK:
            self._work = message
        elif all(map(math.isfinite, (message.x_m, message.y_m, message.heading_rad))):
            self._pose = message.x_m, message.y_m, message.heading_rad
            step_m = math.dist(self._pose[:2], self._counted_m)
            if not step_m < _STEP_M:
                self._odometer_m += 0.0 if math.isnan(step_m) else step_m
                self._counted_m = self._pose[:2]
