"""What is measured in the machine: joints, drive line and hydraulic pressures; and its pose, which no machine knows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray, GroundTruth, Joints, Pressure, Tachometer
from lhdmap.simulation.history import Column
from lhdmap.simulation.sensing.chance import Chance
from lhdmap.simulation.sensing.sections import PressureSettings, WheelSettings

_BAR_PA = 1e5
_STALLED_MPS = 0.05
_AT_REST_MPS = 1e-6


@dataclass(frozen=True, slots=True)
class JointEncoders:
    """Angles and rates of articulation, boom and bucket, with white noise."""

    noise_rad: float

    def __call__(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> Joints:
        """Return the reading of a state."""
        bend, boom, bucket, rate = (self.noise_rad * rng.standard_normal(4)).tolist()
        positions = {
            "articulation": float(state[Column.ARTICULATION]) + bend,
            "boom_lift": float(state[Column.BOOM]) + boom,
            "bucket_tilt": float(state[Column.BUCKET]) + bucket,
        }
        speeds = {
            "articulation": float(state[Column.ARTICULATION_RATE]) + 2.0 * rate,
            "boom_lift": float(state[Column.BOOM_RATE]),
            "bucket_tilt": float(state[Column.BUCKET_RATE]),
        }
        return Joints(stamp_ns, positions, speeds)


@dataclass(frozen=True, slots=True)
class DriveLineSpeed:
    """Speed of the drive line with an error of scale, and white noise while it turns."""

    scale: float
    noise_mps: float

    def __call__(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> Tachometer:
        """Return the reading of a state."""
        speed = float(state[Column.WHEEL_SPEED]) * self.scale
        noise = self.noise_mps * float(rng.standard_normal()) if abs(speed) > _AT_REST_MPS else 0.0
        return Tachometer(stamp_ns, speed + noise)


def drive_line_speed(settings: WheelSettings, seed: int) -> DriveLineSpeed:
    """Return the tachometer; the seed gives the sign of its error."""
    sign = 1.0 if Chance(seed, "tachometer").once().random() < 0.5 else -1.0
    return DriveLineSpeed(1.0 + sign * settings.scale_error, settings.noise_mps)


@dataclass(frozen=True, slots=True)
class PressureGauge:
    """A pressure (bar) of a state, with white noise."""

    bar_of: Callable[[PressureSettings, FloatArray], float]
    settings: PressureSettings

    def __call__(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> Pressure:
        """Return the reading of a state."""
        noise = self.settings.noise_bar * float(rng.standard_normal())
        return Pressure(stamp_ns, _BAR_PA * max(self.bar_of(self.settings, state) + noise, 0.0))


def transmission_bar(settings: PressureSettings, state: FloatArray) -> float:
    """Return the transmission's pressure: idle, and what the wheels give along the drive; all that they give when stalled.

    A machine that reckons its pressures says them itself, here as below.
    """
    if state[Column.TRANSMISSION] > 0.0:
        return float(state[Column.TRANSMISSION])
    speed, traction = float(state[Column.SPEED]), float(state[Column.TRACTION])
    along = abs(traction) if abs(speed) < _STALLED_MPS else math.copysign(traction, traction * speed)
    return min(settings.idle_bar + settings.drive_bar * max(along, 0.0), settings.relief_bar)


def lift_bar(settings: PressureSettings, state: FloatArray) -> float:
    """Return the lift cylinder's pressure: torque of boom, bucket and load about the boom's pivot, by a constant lever.

    At a given angle it is affine in the load, as in Eq. (9) of the autonomous-loading paper.
    """
    if state[Column.LIFT] > 0.0:
        return float(state[Column.LIFT])
    level = max(math.cos(float(state[Column.BOOM])), 0.0)
    return level * (settings.lift_bar + settings.load_bar * 1e-3 * float(state[Column.LOAD]))


def tilt_bar(settings: PressureSettings, state: FloatArray) -> float:
    """Return the tilt cylinder's pressure: between free and relief by the share of its torque that meets something."""
    if state[Column.TILT] > 0.0:
        return float(state[Column.TILT])
    share = min(max(float(state[Column.CURL]), 0.0), 1.0)
    return settings.tilt_bar + share * (settings.tilt_relief_bar - settings.tilt_bar)


def true_pose(stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> GroundTruth:
    """Return the exact pose of `base_link` in `map`."""
    return GroundTruth(stamp_ns, state[:3].copy(), se3.quaternion_from_rpy(*state[3:6].tolist()))
