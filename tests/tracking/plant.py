"""A machine with slip, lags, dead time and noisy sensors, driven by a tracker in the plane: no tyres, no roll."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.messages import FloatArray
from lhdmap.tracking.kernel import State, front_axle, moved, rear_speed
from lhdmap.tracking.path import beside, nearest
from lhdmap.tracking.tracker import Step, Tracker

STEP_NS, PERIOD_NS = 10_000_000, 50_000_000
GRAVITY = 9.81


@dataclass(frozen=True)
class Errors:
    """What the machine is other than its model, and what its sensors add; the findings' noise by default.

    `slip_per_g`: drift of both axles to the outside, rad per g of lateral acceleration; `slip_of`: one more by the way, rad;
    `front_more`: share by which the front axle slips more, and the rear one less; `longer`: share by which the rear body is.
    """

    pose_m: float = 0.05
    heading_deg: float = 0.3
    joint_deg: float = 0.3
    joint_offset_deg: float = 0.5
    slip_per_g: float = 0.12
    slip_of: Callable[[float], float] | None = None
    dead_s: float = 0.0
    gain: float = 1.0
    front_more: float = 0.0
    longer: float = 0.0
    seed: int = 0


CALM = Errors(0.0, 0.0, 0.0, 0.0, 0.0)
"""Nothing is wrong."""
EVEN = Errors(slip_per_g=0.0)
"""Noise, no slip."""


@dataclass
class Drive:
    """Each 50 ms: time, true x1, y1, heading, β, its rate (N, 6), speed of the rear axle, z0, z1, command; how it ended."""

    rows: list[tuple[float, ...]] = field(default_factory=list)
    arrived: bool = False
    reason: str = ""

    def table(self) -> FloatArray:
        """Columns: t, x1, y1, θ1, β, ω, v1, z0, z1, commanded rate, filter's slip, true slip."""
        return np.array(self.rows)


class Plant:
    """The machine as it is."""

    def __init__(self, state: State, model: DriveModel, errors: Errors) -> None:
        self.state, self.speed, self.slip, self.way, self.now_ns = state, 0.0, 0.0, 0.0, 0
        self._model, self._errors = model, errors
        self._rng = np.random.default_rng(errors.seed)
        self.lengths = (model.front_m, (1.0 + errors.longer) * model.rear_m, model.steering_lag_s)
        self.sent: list[Setpoint] = [Setpoint(-2_000_000_000, 0.0, 0.0)]
        self._k = 0

    def step(self) -> None:
        """Move on by 10 ms."""
        model, errors = self._model, self._errors
        until = self.now_ns - round((model.dead_time_s + errors.dead_s) * 1e9)
        while self._k + 1 < len(self.sent) and self.sent[self._k + 1].at_ns <= until:
            self._k += 1
        force, dt = self.sent[self._k], STEP_NS * 1e-9
        change = (force.speed_mps - self.speed) * -math.expm1(-dt / model.drive_lag_s)
        most = model.acceleration_mps2 if self.speed * change >= 0.0 else model.deceleration_mps2
        self.speed += min(max(change, -most * dt), most * dt)
        rate = min(max(errors.gain * force.steering_rate_rps, -model.max_rate_rps), model.max_rate_rps)
        stop = model.max_articulation_rad
        if abs(self.state[3]) >= stop and rate * self.state[3] > 0.0:
            rate = 0.0
            self.state = (*self.state[:3], math.copysign(stop, self.state[3]), 0.0)
        rear = self.rear_mps
        slips = ((1.0 + errors.front_more) * self.slip, (1.0 - errors.front_more) * self.slip)
        after = moved(self.state, rear, rate, dt, self.lengths, slips)
        lateral = rear * (after[2] - self.state[2]) / dt
        extra = errors.slip_of(self.way) if errors.slip_of else 0.0
        self.slip += (-errors.slip_per_g * lateral / GRAVITY + extra - self.slip) * dt / 0.1
        self.state, self.way = after, self.way + abs(rear) * dt
        self.now_ns += STEP_NS

    @property
    def rear_mps(self) -> float:
        return rear_speed(self.speed, self.state[3], self.state[4], self.lengths)

    def measured(self) -> Motion:
        """What the sensors say now."""
        one, noise = self._errors, self._rng.standard_normal(6)
        x, y, heading = front_axle(self.state, self.lengths)
        return Motion(
            self.now_ns,
            x + one.pose_m * noise[0],
            y + one.pose_m * noise[1],
            heading + math.radians(one.heading_deg) * noise[2],
            self.state[3] + math.radians(one.joint_deg * noise[3] + one.joint_offset_deg),
            self.state[4] + math.radians(one.joint_deg) * noise[4],
            self.speed * (1.0 + 0.1 * one.pose_m * noise[5]),
        )


class Stepper(Protocol):
    """A tracker, or a run of legs."""

    def step(self, now_ns: int, motion: Motion | None, sent: Sequence[Setpoint] | None = None) -> Step: ...


def drive(tracker: Tracker, plant: Plant, truth: FloatArray, seconds: float, stepper: Stepper | None = None) -> Drive:
    """Drive what the tracker follows until it arrives, stops or the time is over; `truth`: rows of the exact path.

    `stepper`: who is stepped, where it is not the tracker itself.
    """
    out, begun = Drive(), plant.now_ns
    queue: Setpoints = ()
    near = nearest(truth, *plant.state[:3])
    fronts = near + sum(plant.lengths[:2])
    while plant.now_ns - begun < seconds * 1e9:
        if plant.now_ns % PERIOD_NS == 0:
            step = (stepper or tracker).step(plant.now_ns, plant.measured(), plant.sent[-80:])
            queue = step.setpoints
            x0, y0, _ = front_axle(plant.state, plant.lengths)
            fronts, z0, _, _ = beside(truth, x0, y0, fronts, 6.0, 6.0)
            near, z1, _, _ = beside(truth, plant.state[0], plant.state[1], near, 6.0, 6.0)
            slip = float(tracker.filter.state[5])
            out.rows.append(
                (plant.now_ns * 1e-9, *plant.state, plant.rear_mps, z0, z1, step.steering_rate_rps, slip, plant.slip)
            )
            out.reason = step.reason
            out.arrived = step.state == "arrived" and abs(plant.speed) < 0.01
            if out.arrived or (step.state == "stopped" and abs(plant.speed) < 0.01):
                break
        plant.sent.append(_at(queue, plant.now_ns, plant._model))
        plant.step()
    return out


def _at(queue: Setpoints, now: int, model: DriveModel) -> Setpoint:
    """The command of now, as the executor gives it: interpolated, the drive's lag fed forward."""
    times = np.array([one.at_ns for one in queue], dtype=float)
    speeds, rates = np.array([one.speed_mps for one in queue]), np.array([one.steering_rate_rps for one in queue])
    speed, later = np.interp([now, now + 1e8], times, speeds).tolist()
    return Setpoint(now, speed + model.drive_lag_s * (later - speed) / 0.1, float(np.interp(now, times, rates)))


def placed(x: float, y: float, heading: float, bend: float = 0.0) -> State:
    """A machine at rest by its rear axle."""
    return x, y, heading, bend, 0.0
