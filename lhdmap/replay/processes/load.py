"""The loading task as a process: it has the machine from the approach to a weighed bucket."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from lhdmap.guidance.directive import HEADING, Directive, X, Y
from lhdmap.loading.assistance import ABORT, GO_ON, Answer
from lhdmap.loading.moment import LoadingInput, LoadingOutput, Mission, Target
from lhdmap.loading.states import ASSISTANCE, Event, State
from lhdmap.loading.task import LoadingTask
from lhdmap.messages import Command, FloatArray, Text
from lhdmap.pile.result import Snapshot
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    APPROACH,
    DIRECTIVE,
    LOADING,
    MACHINE_SAYS,
    MILLISECOND_NS,
    MISSION,
    ORDERS,
    PEDALS,
    PILE,
    STATION_SAYS,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.feed import MOTION_TOPICS, MotionFeed
from lhdmap.replay.processes.load_feed import SIGNAL_TOPICS, SignalFeed
from lhdmap.replay.processes.told import Asked, Digs, Health, LoadingNow, Orders, Word

LOADS = "loading"
_ASKS_NS = 100 * MILLISECOND_NS
_SETTLED_NS = 1_000_000_000
_AHEAD_M = 7.5  # of the pile's middle from the front axle of a machine that has been driven up to it
_IN_THE_PILE = (State.CHARGING, State.EXCAVATION, State.PULL_BACK, State.HELD, State.LOADING_ASSISTANCE)
_BEFORE_M, _BEHIND_M, _BESIDE_M = 1.2, 8.0, 0.1


class _Heard:
    """The newest of what others say: orders and way of a mission, the pile, the machine's health, the station's answer.

    `request`: number of the open request, 0: none.
    """

    def __init__(self) -> None:
        self.orders: Orders | None = None
        self.approach: Directive | None = None
        self.pile: Snapshot | None = None
        self.health: Health | None = None
        self.answer: Answer | None = None
        self.request = 0
        self.emergency = False

    def take(self, topic: str, message: Any) -> None:
        """Take a message."""
        if topic == ORDERS:
            self.orders = message
        elif topic == APPROACH:
            self.approach = message.directive
        elif topic == PILE:
            self.pile = message
        elif topic == MACHINE_SAYS:
            self.health = message
        elif topic == STATION_SAYS:
            self.answer = message.answer or self._said_go_on(message) or self.answer
            self.emergency = bool(message.emergency) or (self.emergency and not message.release)

    def _said_go_on(self, word: Word) -> Answer | None:
        """Return what the station says as an answer to the open request."""
        if not self.request or not (word.go_on or word.gave_up):
            return None
        return Answer(self.request, ABORT if word.gave_up else GO_ON, by="station")


class Loads(Process):
    """Pedals each 20 ms or a directive each 100 ms; begins once the machine is armed and its pose has held for a second.

    `way`: path of the approach in `odom`, as it was taught; None: the executive of a mission says when to begin, and navigation
    drives until the pile is found.
    """

    name, period_ns, latency_ns, priority = LOADS, 20 * MILLISECOND_NS, 2 * MILLISECOND_NS, 20
    reads = tuple(dict.fromkeys((*MOTION_TOPICS, *SIGNAL_TOPICS, PILE, MACHINE_SAYS, STATION_SAYS, ORDERS, APPROACH)))

    def __init__(self, task: LoadingTask, way: Directive | None, scribe: Scribe) -> None:
        self.task, self._way, self._scribe = task, way, scribe
        self._feed, self._signals = MotionFeed(), SignalFeed()
        self._wanted = None if way is None else Mission(1, draw_point_of(way))
        self._heard = _Heard()
        self._since_ns: int | None = None
        self._asked_ns, self._mission, self._fill_std, self._number = 0, "", math.nan, 1

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; say what is to be driven, or what the pedals are to do."""
        for received in inbox:
            self._take(received)
        out = self.task.update(self._told(now_ns))
        self._note(out)
        self._heard.request = 0 if out.request is None else out.request.number
        around = np.zeros((0, 2)) if out.target is None else mouth_of(out.target)
        if out.pedals is not None:
            p = out.pedals
            pedals = Command(now_ns, p.propel, p.steering_rate_rps, p.tilt, p.lift, p.full_rpm, p.brake)
            yield Outgoing(PEDALS, Digs(pedals, around))
        if self._has_orders and now_ns - self._asked_ns >= _ASKS_NS:
            self._asked_ns = now_ns
            cause = f"assistance: {out.request.why}" if out.request is not None else out.state.value
            directive = None if out.directive is None else out.directive._replace(stamp_ns=now_ns)
            touched = around if out.pedals is not None or out.state in _IN_THE_PILE else None
            pile = around if out.state == State.POSITIONING else None
            yield Outgoing(DIRECTIVE, Asked(now_ns, directive, cause, touched, pile))
        mission = self._told_of(out)
        yield Outgoing(LOADING, self._now(now_ns, out))
        if mission != self._mission and self._way is not None:
            self._mission = mission
            self._scribe.event("mission", mission)
            yield Outgoing(MISSION, Text(now_ns, mission))

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic in MOTION_TOPICS:
            self._feed.take(received)
        if topic in SIGNAL_TOPICS:
            self._signals.take(received)
        else:
            self._heard.take(topic, message)

    def _told(self, now_ns: int) -> LoadingInput:
        motion, health = self._feed.motion, self._heard.health
        answer, self._heard.answer = self._heard.answer, None
        way = self._heard.approach if self._way is None else self._way._replace(stamp_ns=now_ns)
        return LoadingInput(
            now_ns,
            self._signals.signals(),
            motion,
            self._heard.pile,
            None if motion is None else self._signals.walls_m(motion),
            "idle" if health is None else health.mode,
            health is not None and health.armed,
            answer,
            self._heard.emergency,
            self._mission_now(now_ns),
            way,
            evidence=(("log", f"run.mcap@{now_ns}"),),
        )

    @property
    def _has_orders(self) -> bool:
        """Whether the machine is this task's."""
        return self._way is not None or (self._heard.orders is not None and self._heard.orders.loading > 0)

    def _mission_now(self, now_ns: int) -> Mission | None:
        if self._way is not None:
            return self._wanted if self._settled(now_ns) else None
        return (
            Mission(self._heard.orders.loading)
            if self._heard.orders is not None and self._heard.orders.loading
            else None
        )

    def _settled(self, now_ns: int) -> bool:
        """Return whether the machine has been there for a while, with a pose: the mission begins."""
        if self._feed.motion is None:
            return False
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        return now_ns - self._since_ns >= _SETTLED_NS

    def _now(self, now_ns: int, out: LoadingOutput) -> LoadingNow:
        if self._heard.orders is not None and self._heard.orders.loading:
            self._number = self._heard.orders.loading
        return LoadingNow(
            now_ns, self._number, out.state, out.phase, out.attempts, out.fill, self._fill_std, out.request
        )

    def _note(self, out: LoadingOutput) -> None:
        for note in out.notes:
            values = {"attempt": out.attempts, **note.values}
            self._fill_std = note.values.get("fill_std", self._fill_std)
            if note.event == "state":
                self._scribe.goes(note.after, note.cause, **values)
            else:
                self._scribe.event(note.event, note.cause, **values)

    @staticmethod
    def _told_of(out: LoadingOutput) -> str:
        if out.state in ASSISTANCE:
            return f"assistance: {out.request.why if out.request is not None else out.state.value}"
        if out.state == State.ABORTED:
            return f"aborted: {Event.ABORT.value}"
        return "done" if out.state == State.DONE else "driving"


def mouth_of(target: Target) -> FloatArray:
    """Return corners (4, 2) in `odom`, counterclockwise, of where the bucket is to touch: from before the toe on."""
    c, s = math.cos(target.heading_rad), math.sin(target.heading_rad)
    ahead, left = np.array([c, s]), np.array([-s, c])
    right_m, left_m = target.limits_m[0] - _BESIDE_M * left, target.limits_m[1] + _BESIDE_M * left
    return np.stack(
        [
            right_m - _BEFORE_M * ahead,
            right_m + _BEHIND_M * ahead,
            left_m + _BEHIND_M * ahead,
            left_m - _BEFORE_M * ahead,
        ]
    )


def draw_point_of(way: Directive) -> tuple[float, float]:
    """Return about where the pile's middle is: before the end of the taught way."""
    x, y, heading = way.path[-1, [X, Y, HEADING]].tolist()
    return x + _AHEAD_M * math.cos(heading), y + _AHEAD_M * math.sin(heading)
