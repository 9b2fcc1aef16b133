"""A scripted operator: drives the legs of a route on the truth. The only driver that may see it; for teaching drives and tests.

He looks ahead over the machine's dead time with the commands that he has already given, steers the leading axle onto its way
by what its curvature asks for and by how far both axles are off, and drives as fast as bends, joint and stops allow.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.mine.ways import STEP_M, Leg
from lhdmap.settings import setting
from lhdmap.simulation.noise_field import Scales, noise_field
from lhdmap.simulation.vehicle.state import VehicleState

_LOOK_AHEAD_M, _LOOK_AHEAD_S = 2.2, 0.7
_JOINT_GAIN_PS = 2.0
_TRAIL_SHARE = 0.3  # how much of the trailing axle's error counts
_CREEP_MPS = 0.12
_AT_REST_MPS = 0.02
_STUCK_S = 20.0
_BEHIND, _AHEAD = 20, 120  # samples of the way that are searched for the nearest


@dataclass(frozen=True, slots=True)
class OperatorSettings:
    """How a person drives."""

    speed_kmh: float = setting(10.0, unit="km/h", minimum=0.5, maximum=40.0, doc="Speed on straights.")
    lateral_mps2: float = setting(1.2, unit="m/s²", minimum=0.1, maximum=5.0, doc="Acceleration in bends.")
    acceleration_mps2: float = setting(0.6, unit="m/s²", minimum=0.05, maximum=3.0, doc="Rate of speeding up.")
    braking_mps2: float = setting(0.5, unit="m/s²", minimum=0.05, maximum=3.0, doc="Rate of slowing down.")
    joint_share: float = setting(0.6, minimum=0.1, maximum=1.0, doc="Share of the joint's rate that bends may ask for.")
    dwell_s: float = setting(1.5, unit="s", minimum=0.0, maximum=600.0, doc="Rest before a change of gear.")
    stop_s: float = setting(4.0, unit="s", minimum=0.0, maximum=3600.0, doc="Rest at a place of the route.")
    wander_m: float = setting(
        0.0, unit="m", minimum=0.0, maximum=1.0, doc="Slow lateral wandering, standard deviation."
    )
    speed_variation: float = setting(0.03, minimum=0.0, maximum=0.3, doc="Slow changes of the speed, share of it.")


def wander_of(settings: OperatorSettings, way_m: float, seed: int) -> FloatArray | None:
    """Return the operator's lateral offset, shape (N, 2): driven way (m), offset (m); None where he does not wander."""
    if settings.wander_m == 0.0:
        return None
    field = noise_field(np.random.default_rng([seed, 77]), Scales(2, 9.0, 0.4), (0.0, way_m), (0.0, 1.0))
    at = np.arange(0.0, way_m + 1.0, 0.5)
    field.normalise(at, np.zeros(1), settings.wander_m)
    return np.stack([at, field.grid(at, np.zeros(1))[:, 0]], axis=1)


class _Driven(NamedTuple):
    """What the operator knows of the machine: joint to both axles, top speed, rate of the joint, lag of the drive."""

    front_m: float
    rear_m: float
    top_mps: float
    rate_rps: float
    lag_s: float

    @classmethod
    def of(cls, machine: Machine) -> Self:
        size = machine.dimensions
        top_mps, rate_rps = size.max_speed_kmh / 3.6, math.radians(size.max_articulation_rate_dps)
        axles_m = size.joint_to_front_axle_m, size.joint_to_rear_axle_m
        return cls(*axles_m, top_mps, rate_rps, machine.drive.lag_s)


class Operator:
    """Drives legs one after the other; `command` is asked at a fixed period."""

    def __init__(
        self,
        legs: Sequence[Leg],
        machine: Machine,
        settings: OperatorSettings,
        *,
        seed: int = 0,
        period_s: float = 0.05,
    ) -> None:
        self._legs, self._settings, self._period_s = legs, settings, period_s
        self._machine = _Driven.of(machine)
        delay_s = machine.drive.dead_time_s + period_s
        self._given: deque[float] = deque([0.0] * max(round(delay_s / period_s), 1))  # what has not taken effect yet
        rng = np.random.default_rng([seed, 78])
        self._phase = rng.uniform(0.0, 2 * np.pi, 2)
        self._speeds = [self._profile(leg) for leg in legs]
        self.leg = 0
        self._at = 0
        self._resting_since_ns: int | None = None
        self._slow_since_ns: int | None = None

    @property
    def done(self) -> bool:
        """Whether the route has been driven."""
        return self.leg >= len(self._legs)

    def command(self, state: VehicleState, now_ns: int) -> Command:
        """Return what he does at this moment."""
        if self.done:
            return _halt(now_ns)
        leg = self._legs[self.leg]
        if self._resting_since_ns is not None:
            rest_s = self._settings.stop_s if leg.stop else self._settings.dwell_s
            if (now_ns - self._resting_since_ns) * 1e-9 >= rest_s:
                self.leg, self._at, self._resting_since_ns = self.leg + 1, 0, None
            return self._told(_halt(now_ns))
        return self._told(self._drive(leg, state, now_ns))

    def _told(self, command: Command) -> Command:
        self._given.append(command.steering_rate_rps)
        self._given.popleft()
        return command

    def _drive(self, leg: Leg, state: VehicleState, now_ns: int) -> Command:
        lead, speed = self._ahead(leg, state)
        self._at = _nearest(leg, lead[0], lead[1], self._at)
        remaining_m = STEP_M * (len(leg.x_m) - 1 - self._at) - max(self._beyond(leg, lead), 0.0)
        if self._arrived(remaining_m, state, now_ns):
            self._resting_since_ns = now_ns
            return _halt(now_ns)
        wanted = self._wanted_mps(leg, speed, remaining_m)
        propel = leg.gear * wanted / self._machine.top_mps
        return Command(now_ns, propel, leg.gear * self._steer(leg, lead, speed), 0.0, 0.0, False, remaining_m < 0.03)

    def _ahead(self, leg: Leg, state: VehicleState) -> tuple[tuple[float, float, float, float], float]:
        """Return x, y, heading of motion and joint angle of the leading body when the next command takes effect, and its speed."""
        c, s = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
        bend, speed, sign = state.articulation_rad, abs(state.speed_mps), float(leg.gear)
        x, y, heading = state.x_m, state.y_m, state.yaw_rad
        lead_m, trail_m = self._machine.front_m, self._machine.rear_m
        if leg.gear < 0:
            back, left = (
                -self._machine.front_m - self._machine.rear_m * math.cos(bend),
                self._machine.rear_m * math.sin(bend),
            )
            x, y, heading = x + c * back - s * left, y + s * back + c * left, state.yaw_rad - bend + math.pi
            bend, lead_m, trail_m = -bend, trail_m, lead_m
        for rate in self._given:
            turn = speed * math.sin(bend) + trail_m * sign * rate
            heading += self._period_s * turn / (lead_m * math.cos(bend) + trail_m)
            x += self._period_s * speed * math.cos(heading)
            y += self._period_s * speed * math.sin(heading)
            bend += self._period_s * sign * rate
        return (x, y, heading, bend), speed

    def _steer(self, leg: Leg, lead: tuple[float, float, float, float], speed: float) -> float:
        """Return the rate of the leading body's joint angle."""
        x, y, heading, bend = lead
        ahead = min(self._at + round(0.1 * speed / STEP_M), len(leg.x_m) - 1)
        off_m, turned = _errors(leg, self._at, x, y, heading)
        back = max(self._at - round((self._machine.front_m + self._machine.rear_m) / STEP_M), 0)
        tx, ty = self._trailing(leg, lead)
        trail_off_m, _ = _errors(leg, back, tx, ty, heading)
        off_m = (1.0 - _TRAIL_SHARE) * off_m + _TRAIL_SHARE * trail_off_m if back > 0 else off_m
        look_m = _LOOK_AHEAD_M + _LOOK_AHEAD_S * speed
        curvature = -off_m / look_m**2 - 1.6 * turned / look_m
        wanted = leg.articulation_rad[ahead] + (self._machine.front_m + self._machine.rear_m) * curvature
        following = min(ahead + 4, len(leg.x_m) - 1)
        slope = (leg.articulation_rad[following] - leg.articulation_rad[ahead]) / (STEP_M * max(following - ahead, 1))
        rate = slope * speed + _JOINT_GAIN_PS * (wanted - bend)
        return float(np.clip(rate, -self._machine.rate_rps, self._machine.rate_rps))

    def _trailing(self, leg: Leg, lead: tuple[float, float, float, float]) -> tuple[float, float]:
        """Return x, y of the trailing axle."""
        x, y, heading, bend = lead
        lead_m, trail_m = (
            (self._machine.front_m, self._machine.rear_m)
            if leg.gear > 0
            else (self._machine.rear_m, self._machine.front_m)
        )
        back = heading - bend
        return (
            x - lead_m * math.cos(heading) - trail_m * math.cos(back),
            y - lead_m * math.sin(heading) - trail_m * math.sin(back),
        )

    def _beyond(self, leg: Leg, lead: tuple[float, float, float, float]) -> float:
        """Return how far the leading axle is beyond the nearest sample, along the way."""
        heading = leg.heading_rad[self._at]
        dx, dy = lead[0] - leg.x_m[self._at], lead[1] - leg.y_m[self._at]
        return float(dx * math.cos(heading) + dy * math.sin(heading))

    def _wanted_mps(self, leg: Leg, speed: float, remaining_m: float) -> float:
        """Return the speed to ask for: that of the way where the drive will have followed, less near the end."""
        ahead = min(self._at + round(self._machine.lag_s * speed / STEP_M), len(leg.x_m) - 1)
        way = STEP_M * self._at
        wave = math.sin(2 * math.pi * way / 31.0 + self._phase[0]) + math.sin(2 * math.pi * way / 11.0 + self._phase[1])
        wanted = float(self._speeds[self.leg][ahead]) * (1.0 + self._settings.speed_variation * wave)
        left_m = max(remaining_m - 0.8 * self._machine.lag_s * speed, 0.0)
        wanted = min(wanted, math.sqrt(2.0 * self._settings.braking_mps2 * left_m))
        return max(wanted, _CREEP_MPS) if remaining_m > 0.03 else 0.0

    def _arrived(self, remaining_m: float, state: VehicleState, now_ns: int) -> bool:
        """Return whether he has come to rest at the end of a leg, or cannot come nearer."""
        if abs(state.speed_mps) > _AT_REST_MPS:
            self._slow_since_ns = None
            return False
        self._slow_since_ns = now_ns if self._slow_since_ns is None else self._slow_since_ns
        return remaining_m < 0.15 or (now_ns - self._slow_since_ns) * 1e-9 > _STUCK_S

    def _profile(self, leg: Leg) -> FloatArray:
        """Return the speed (m/s) at each sample of a leg."""
        settings = self._settings
        slope = np.abs(np.gradient(leg.articulation_rad, STEP_M)) if len(leg.x_m) > 2 else np.zeros(len(leg.x_m))
        speed = np.full(len(leg.x_m), min(settings.speed_kmh / 3.6, self._machine.top_mps))
        speed = np.minimum(speed, np.sqrt(settings.lateral_mps2 / np.maximum(np.abs(leg.curvature_pm), 1e-6)))
        speed = np.minimum(speed, settings.joint_share * self._machine.rate_rps / np.maximum(slope, 1e-6))
        speed = np.maximum(speed, 3.0 * _CREEP_MPS)
        speed[-1] = 0.0
        gain = 2.0 * settings.braking_mps2 * STEP_M
        square = speed**2
        for k in range(len(square) - 2, -1, -1):
            square[k] = min(square[k], square[k + 1] + gain)
        return np.sqrt(square)


def _halt(now_ns: int) -> Command:
    return Command(now_ns, 0.0, 0.0, 0.0, 0.0, False, True)


def _nearest(leg: Leg, x: float, y: float, at: int) -> int:
    first, last = max(at - _BEHIND, 0), min(at + _AHEAD, len(leg.x_m))
    square = (leg.x_m[first:last] - x) ** 2 + (leg.y_m[first:last] - y) ** 2
    return first + int(np.argmin(square))


def _errors(leg: Leg, at: int, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return how far a point is to the left of the way, and how much a heading is turned from it (rad)."""
    way = float(leg.heading_rad[at])
    dx, dy = x - float(leg.x_m[at]), y - float(leg.y_m[at])
    turned = (heading - way + math.pi) % (2 * math.pi) - math.pi
    return -dx * math.sin(way) + dy * math.cos(way), turned
