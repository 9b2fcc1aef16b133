"""A planar drive in closed loop: walls as points, a machine with lags and dead time, guidance each 50 ms. No sensors."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lhdmap.driving.kernel import stepped
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.guidance.planner import Guidance, Plan, method_of
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.messages import FloatArray

from tests.guidance.tunnels import BODIES, MACHINE, headings, room

PERIOD_NS, STEP_NS = 50_000_000, 10_000_000
EYES_M = {1: 0.8, -1: 3.0}
_SECOND_NS = 1_000_000_000
_NEAR_M, _BESIDE_M = 25.0, 9.0


@dataclass(frozen=True)
class Errors:
    """What the machine is other than its model: gains, lags as shares; offsets; white noise of the pose; the route's offset."""

    gain: float = 1.0
    lag: float = 1.0
    dead_s: float = 0.0
    bend_offset_rad: float = 0.0
    jitter_m: float = 0.0
    jitter_rad: float = 0.0
    route_m: float = 0.0
    seed: int = 0


@dataclass
class Drive:
    """What came of a drive: each 0.1 s the true room, speed and state; each plan; the commands; the work of a plan in ms."""

    rooms_m: list[float] = field(default_factory=list)
    speeds_mps: list[float] = field(default_factory=list)
    states: list[FloatArray] = field(default_factory=list)
    plans: list[Plan] = field(default_factory=list)
    commands: list[Setpoint] = field(default_factory=list)
    work_ms: list[float] = field(default_factory=list)
    left_m: list[float] = field(default_factory=list)
    arrived: bool = False
    contact: bool = False


class Truth:
    """The machine as it is: drive and joint follow what was commanded a dead time ago."""

    def __init__(self, state: FloatArray, model: DriveModel, errors: Errors) -> None:
        self.state, self.speed, self._model, self._errors = state, 0.0, model, errors
        self.sent: list[Setpoint] = [Setpoint(-_SECOND_NS, 0.0, 0.0)]
        self._in_force = 0

    def step(self, now_ns: int) -> None:
        """Move on by 10 ms."""
        model, errors, sent = self._model, self._errors, self.sent
        until = now_ns - round((model.dead_time_s + errors.dead_s) * _SECOND_NS)
        while self._in_force + 1 < len(sent) and sent[self._in_force + 1].at_ns <= until:
            self._in_force += 1
        force = sent[self._in_force]
        change = (force.speed_mps - self.speed) * -math.expm1(-0.01 / (errors.lag * model.drive_lag_s))
        faster = model.acceleration_mps2 if self.speed * change >= 0.0 else model.deceleration_mps2
        self.speed += min(max(change, -faster * 0.01), faster * 0.01)
        rate, lag = errors.gain * force.steering_rate_rps, errors.lag * model.steering_lag_s
        state = (self.state[0], self.state[1], self.state[2], self.state[3], self.state[4])
        self.state = np.array(stepped(state, self.speed, rate, 0.01, model.front_m, model.rear_m, lag))


def driving(
    line: FloatArray,
    walls: FloatArray,
    gear: int = 1,
    *,
    limit_mps: float = 2.8,
    settings: GuidanceSettings | None = None,
    seconds: float = 90.0,
    errors: Errors = Errors(),
    load_kg: float = 0.0,
    begin_m: float = 12.0,
    short_m: float = 5.0,
    until_m: float = math.inf,
    route: FloatArray | float = 1.0,
) -> Iterator[Drive]:
    """Drive a line from near its start to a stop before its end; in reverse the rear axle goes first. `route`: its weights.

    Yields what has come of it so far, each 0.1 s.
    """
    used, model = settings or GuidanceSettings(), drive_model(MACHINE, load_kg)
    guidance = Guidance(model, BODIES, EYES_M, used, method_of(used))
    lead = lead_of(gear, model, BODIES)
    told = line + errors.route_m * np.column_stack([-np.sin(headings(line)), np.cos(headings(line))])
    path = path_of(told, limit_mps, route)
    directive = Directive(0, gear, path, float(path[-1, 5]) - short_m)
    at, heading = line[round(begin_m / 0.1)], headings(line)[round(begin_m / 0.1)]
    base = lead.base((float(at[0]), float(at[1]), float(heading), 0.0, 0.0))
    truth, rng = Truth(np.array([*base, 0.0, 0.0]), model, errors), np.random.default_rng(errors.seed)
    now, out = 0, Drive()
    queue: Setpoints = ()
    out.commands = truth.sent
    while now < seconds * _SECOND_NS and not out.arrived and not out.contact:
        if now % PERIOD_NS == 0:
            motion = _measured(now, truth, errors, rng)
            hits = walls[np.hypot(*(walls - truth.state[:2]).T) < _NEAR_M]
            begun = time.thread_time()
            plan = guidance.plan(now, motion, truth.sent[-60:], hits, directive)
            out.work_ms.append(1e3 * (time.thread_time() - begun))
            queue = plan.setpoints
            out.plans.append(plan)
        if now % 20_000_000 == 0:
            truth.sent.append(_at(queue, now, model))
        truth.step(now)
        now += STEP_NS
        if now % 100_000_000 == 0:
            _note(out, now, truth, walls)
            leading = lead.state(_motion(now, truth))
            out.left_m.append(directive.stop_m - _along(path, leading[0], leading[1]))
            out.arrived = out.left_m[-1] < 0.3 and abs(truth.speed) < 0.03
            yield out
            if out.left_m[-1] < directive.stop_m - until_m:
                break


def drive(line: FloatArray, walls: FloatArray, gear: int = 1, **how: Any) -> Drive:
    """Drive to the end (`driving`)."""
    out = Drive()
    for out in driving(line, walls, gear, **how):  # noqa: B007  # the last one is wanted
        pass
    return out


def _note(out: Drive, now: int, truth: Truth, walls: FloatArray) -> None:
    near = walls[np.hypot(*(walls - truth.state[:2]).T) < _BESIDE_M]
    out.rooms_m.append(min(room(truth.state, near), 3.0) if len(near) else 3.0)
    out.speeds_mps.append(truth.speed)
    out.states.append(truth.state.copy())
    out.contact = out.rooms_m[-1] <= 0.0


def _along(path: FloatArray, x: float, y: float) -> float:
    near = int(np.hypot(path[:, 0] - x, path[:, 1] - y).argmin())
    c, s = math.cos(path[near, 2]), math.sin(path[near, 2])
    return float(path[near, 5] + c * (x - path[near, 0]) + s * (y - path[near, 1]))


def _motion(now: int, truth: Truth) -> Motion:
    x, y, heading, bend, rate = truth.state.tolist()
    return Motion(now, x, y, heading, bend, rate, truth.speed)


def _measured(now: int, truth: Truth, errors: Errors, rng: np.random.Generator) -> Motion:
    one, noise = _motion(now, truth), rng.standard_normal(3)
    return one._replace(
        x_m=one.x_m + errors.jitter_m * noise[0],
        y_m=one.y_m + errors.jitter_m * noise[1],
        heading_rad=one.heading_rad + errors.jitter_rad * noise[2],
        articulation_rad=one.articulation_rad + errors.bend_offset_rad,
    )


def _at(queue: Setpoints, now: int, model: DriveModel) -> Setpoint:
    """The command of now, as the executor gives it: interpolated, the drive's lag fed forward."""
    times = np.array([one.at_ns for one in queue], dtype=float)
    speeds, rates = np.array([one.speed_mps for one in queue]), np.array([one.steering_rate_rps for one in queue])
    speed, later = np.interp([now, now + 1e8], times, speeds).tolist()
    return Setpoint(now, speed + model.drive_lag_s * (later - speed) / 0.1, float(np.interp(now, times, rates)))
