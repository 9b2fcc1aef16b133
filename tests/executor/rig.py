"""A machine of two lines under `Control`, with inputs that can fail one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.executor.control import Control
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray

MACHINE = Machine()
MODEL, BODIES = drive_model(MACHINE), bodies_of(MACHINE)
INPUTS = {"motion": 0.01, "scan_front": 0.04, "pose": 0.04, "link": 0.1, "operator": 0.05}
MS = 1_000_000
PERIOD_MS = 10


def ahead(speed: float, now_ns: int, rate: float = 0.0) -> Setpoints:
    return tuple(Setpoint(now_ns + round(k * 0.15e9), speed, rate) for k in range(25))


class Rig:
    """A machine of two lines, with inputs that can fail one by one."""

    def __init__(self, settings: ExecutorSettings | None = None, inputs: Mapping[str, float] = INPUTS) -> None:
        self.inputs = inputs
        self.control = Control(MODEL, BODIES, settings or ExecutorSettings(), inputs)
        self.now_ms, self.x_m, self.speed = 1000, 0.0, 0.0
        self.failed: set[str] = set()
        self.seen = dict.fromkeys(INPUTS, -(10**9))
        self.apart_m, self.apart_rad, self.thing_m = 0.0, 0.0, math.inf
        self.beside: list[tuple[float, float]] = []
        self.own: list[tuple[float, float]] = []
        self.speed_wanted, self.rate_wanted, self.plans, self.operates = 2.0, 0.0, True, True
        self.command = Command(0, 0.0, 0.0, 0.0, 0.0, full_rpm=False, brake=True)
        self._given: list[Command] = []
        self.braking_ms = 0

    @property
    def now_ns(self) -> int:
        return self.now_ms * MS

    def motion(self) -> Motion:
        return Motion(self.now_ns, self.x_m, 0.0, 0.0, 0.0, 0.0, self.speed)

    def points(self) -> FloatArray:
        beside = np.array([(x - self.x_m, y) for x, y in self.beside] + self.own).reshape(-1, 2)
        if math.isinf(self.thing_m):
            return beside
        thing = np.column_stack([np.full(20, self.thing_m - self.x_m), np.linspace(-1.0, 1.0, 20)])
        return np.concatenate([thing, beside])

    def run(self, seconds: float, each: Callable[[], object] = lambda: None) -> None:
        for _ in range(round(seconds * 1e3 / PERIOD_MS)):
            self.tick()
            each()

    def tick(self) -> None:
        self.now_ms += PERIOD_MS
        control, now = self.control, self.now_ns
        for name, period_s in self.inputs.items():
            if name in self.failed or self.now_ms % round(1e3 * period_s):
                continue
            fresh = (
                control.disagreement(now, now, self.apart_m, self.apart_rad)
                if name == "pose"
                else control.saw(name, now, now)
            )
            if fresh:
                self.seen[name] = self.now_ms
            if name == "scan_front":
                control.points(name, self.points(), self.motion())
        if self.now_ms % 50 == 0 and self.plans and "guidance" not in self.failed:
            control.plan("guidance", ahead(self.speed_wanted, now, self.rate_wanted), now, now)
        if self.now_ms % 50 == 0 and "operator" not in self.failed and self.operates:
            control.operate(self.speed_wanted, self.rate_wanted, now, now)
        self.command = control.step(now, None if "motion" in self.failed else self.motion())
        self._given.append(self.command)
        self._move(self._given[max(len(self._given) - 26, 0)])

    def _move(self, counts: Command) -> None:
        step = PERIOD_MS * 1e-3
        if counts.brake:
            self.braking_ms += PERIOD_MS
            force = MODEL.brake_mps2 * min(self.braking_ms * 1e-3 / MODEL.brake_ramp_s, 1.0)
            self.speed = math.copysign(max(abs(self.speed) - force * step, 0.0), self.speed)
        else:
            self.braking_ms = 0
            change = (counts.propel * MODEL.top_speed_mps - self.speed) * step / MODEL.drive_lag_s
            self.speed += min(max(change, -1.5 * step), 1.0 * step)
        self.x_m += self.speed * step
