"""The executive of a mission as a process: buckets from draw points to dumps, by orders to navigation, loading and dumping."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput, Navigation, Report
from lhdmap.loading.states import ASSISTANCE, State
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import Located
from lhdmap.navigation.presence import Presence
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    DUMPING,
    LOADING,
    LOCATED,
    MACHINE_SAYS,
    MILLISECOND_NS,
    NAVIGATING,
    POSE,
    STATION_SAYS,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.feed import JOINTS
from lhdmap.replay.processes.order_book import OrderBook, Task
from lhdmap.replay.processes.told import DumpingNow, Health, LoadingNow, Navigating, Orders
from lhdmap.topology.model import TopologicalMap

EXECUTIVE = "mission"
_STEP_M = 0.1
_NEAR_M = 26.0  # of the way to the draw point: from here on the pile is looked for while the machine rolls
HAS_THE_MACHINE = frozenset(State) - {State.IDLE, State.IDENTIFICATION, State.DONE, State.ABORTED}
"""States of the loading task in which it drives the machine, and navigation does not."""


class SharedMap(NamedTuple):
    """What a machine among others knows of the map: the nodes (ids) that it may be in, and what it is in itself."""

    free: Callable[[], frozenset[str]]
    presence: Presence


class Executive(Process):
    """Each 100 ms the mission task is told what is, and its outputs become orders.

    Near its draw point the loading task is begun while navigation still drives: the pile is identified without stopping. Once it
    has the machine, navigation counts as arrived.
    """

    name, period_ns, latency_ns, priority = EXECUTIVE, 100 * MILLISECOND_NS, 5 * MILLISECOND_NS, 15
    reads = (POSE, JOINTS, LOCATED, NAVIGATING, LOADING, DUMPING, MACHINE_SAYS, STATION_SAYS)

    def __init__(
        self,
        task: Task,
        orders: Sequence[Buckets],
        topology: TopologicalMap,
        full_t: float,
        scribe: Scribe,
        *,
        shares: SharedMap | None = None,
    ) -> None:
        """`shares`: of a machine among others."""
        self.task, self._buckets, self._book, self._shares = task, tuple(orders), OrderBook(scribe), shares
        self._topology, self._full_t = topology, full_t
        self._located: Located | None = None
        self._navigating: Navigating | None = None
        self._loading: LoadingNow | None = None
        self._dumping: DumpingNow | None = None
        self._health: Health | None = None
        self._orders, self._key, self._loads = Orders(0, 0, "", loaded=False), ("", False, 0), 0
        self._emergency = self._go_on = self._gave_up = False
        self._task = 0
        self._articulation_rad, self._inside, self._node = 0.0, frozenset[str](), ""
        self._odometer_m, self._place = 0.0, np.full(2, np.nan)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give orders, and each cycle that has ended."""
        for received in inbox:
            self._take(received)
        if self._located is None or self._health is None:
            return
        out = self.task.update(self._told(now_ns))
        self._task = out.task
        self._orders = self._ordered(now_ns, out)
        yield from self._book.say(now_ns, out, self._orders, self._odometer_m)

    def _told(self, now_ns: int) -> MissionInput:
        located = self._located
        assert located is not None  # noqa: S101  # nothing is told before there is a place
        known = located.status == "tracking"
        if known and self._shares is not None:
            place = located.pose_map, located.height_m
            self._inside = self._shares.presence.nodes(*place, self._articulation_rad)
            self._node = self._shares.presence.node_at(*place)
        x, y, yaw = located.pose_map.tolist()
        return MissionInput(
            now_ns,
            pose_map=(x, y, yaw) if known else None,
            odometer_m=self._odometer_m,
            navigation=self._navigation(),
            loading=self._loaded(),
            dumping=self._dumped(),
            estop=self._emergency,
            orders=self._buckets,
            abort=self._gave_up,
            answer="go_on" if self._go_on else "",
            inside=self._inside,
        )

    def _navigation(self) -> Navigation:
        """Return what navigation says of the order that holds; arrived where the loading task has taken the machine over.

        Among others it has arrived once it truly is in the node of its draw point: sections are given back by that.
        """
        told, orders = self._navigating, self._orders
        if self._takes_over():
            there = self._shares is None or self._node == getattr(self._topology.called(orders.goal), "node", "")
            return Navigation("arrived" if there else "driving", orders.goal)
        if told is None or told.number != orders.number:
            return Navigation()
        return Navigation(told.state, told.goal, told.reason)

    def _takes_over(self) -> bool:
        now = self._loading
        return now is not None and self._orders.loading == now.number > 0 and now.state in HAS_THE_MACHINE

    def _loaded(self) -> Report:
        """Return what the loading task says, by the numbers of the mission's tasks."""
        now, task = self._loading, self._task
        if now is None or now.number != self._loads or not self._orders.loading:
            return Report()
        mass_t = now.fill * self._full_t
        if now.state == State.DONE:
            return Report(task, "done", mass_t, now.fill, now.attempts)
        if now.state == State.ABORTED:
            return Report(task, "failed", reason="aborted")
        asks = now.request.why if now.request is not None else ""
        if now.state in ASSISTANCE:
            return Report(task, "assistance", reason=asks)
        return Report(task, "busy")

    def _dumped(self) -> Report:
        now = self._dumping
        if now is None or now.task != self._task:
            return Report()
        if now.state == "done":
            return Report(now.task, "done", 0.0)
        return Report(now.task, "failed", reason=now.reason) if now.state == "failed" else Report(now.task, "busy")

    def _ordered(self, now_ns: int, out: MissionOutput) -> Orders:
        """Return the orders that follow from what the mission task asks."""
        key = out.goal or self._key[0], out.loaded, out.task
        number = self._orders.number + (bool(out.goal) and key != self._key)
        if out.goal:
            self._key = key
        near = self._navigating is not None and self._navigating.number == number and self._navigating.left_m < _NEAR_M
        free = None if self._shares is None else self._shares.free()
        begins = not out.loaded and near and self._draws(out.goal, free)
        if (begins or out.begin == "load") and not self._orders.loading:
            self._loads += 1
        runs = out.begin == "load" or (not out.loaded and (begins or bool(self._orders.loading)))
        goal = out.goal or (self._orders.goal if out.begin == "load" else "")
        loading, dumping = self._loads if runs else 0, out.task if out.begin == "dump" else 0
        return Orders(now_ns, number, goal, out.loaded, loading, dumping, free)

    def _draws(self, goal: str, free: frozenset[str] | None) -> bool:
        """Return whether a goal is a draw point that may be driven to: the loading task drives there without asking anybody."""
        found = self._topology.called(goal) if goal else None
        return getattr(found, "purpose", "") == "draw_point" and (free is None or getattr(found, "node", "") in free)

    def _drive(self, place_m: FloatArray) -> None:
        """Count the way, by steps that are no noise."""
        step_m = float(np.hypot(*(place_m - self._place)))
        if not step_m < _STEP_M:
            self._odometer_m += 0.0 if math.isnan(step_m) else step_m
            self._place = place_m.copy()

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic == POSE:
            self._drive(message.T_odom_base[:2, 3])
        elif topic == JOINTS:
            bend_rad = message.positions_rad.get("articulation", math.nan)
            self._articulation_rad = bend_rad if math.isfinite(bend_rad) else self._articulation_rad
        elif topic == LOCATED:
            self._located = message
        elif topic == NAVIGATING:
            self._navigating = message
        elif topic == LOADING:
            self._loading = message
        elif topic == DUMPING:
            self._dumping = message
        elif topic == MACHINE_SAYS:
            self._health = message
        elif topic == STATION_SAYS:
            self._emergency = bool(message.emergency) or (self._emergency and not message.release)
            self._go_on = message.go_on
            self._gave_up |= bool(message.gave_up)
