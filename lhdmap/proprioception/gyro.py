"""The turn of the machine from the gyroscope of its inclinometer: the heading's rate, added up.

Angular velocity (p, q, r) of the body, with its mount undone, turns the heading by (q sin(roll) + r cos(roll)) / cos(pitch): the
third row of the Euler rates (Titterton and Weston, *Strapdown Inertial Navigation Technology*, 3.6). Nothing is taken off here: what
a gyroscope is wrong by, only the scans can tell (`lhdmap.smoothing.heading`, `lhdmap.odometry.gyro_turn`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray, Inclination
from lhdmap.proprioception.samples import SampleBuffer, Warnings
from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class GyroSettings:
    """The gyroscope beside the inclinometer: a log without one goes its way as if this were not there."""

    enabled: bool = setting(True, doc="Use the yaw rate of the inclinometer's messages, where they have one.")
    noise_deg_sqrt_h: float = setting(
        0.6,
        unit="deg/sqrt(h)",
        minimum=1e-3,
        maximum=100.0,
        source="lhdmap: industrial MEMS have 0.2 to 0.6",
        doc="Random walk of the angle at least; more where its readings at rest or the scans tell of more.",
    )
    bias_deg_h: float = setting(
        20.0,
        unit="deg/h",
        minimum=0.0,
        maximum=1e5,
        source="lhdmap: bias from switch-on to switch-on of calibrated industrial MEMS",
        doc="Constant part of its error, standard deviation, before anything was learned of it.",
    )
    bias_walk_deg_h: float = setting(
        2.0,
        unit="deg/h/sqrt(h)",
        minimum=0.0,
        maximum=1e5,
        source="lhdmap: as bias_deg_h",
        doc="How that part wanders in an hour, standard deviation.",
    )
    max_gap_s: float = setting(
        0.1, unit="s", minimum=0.005, maximum=5.0, doc="Over a longer gap the turn is not known."
    )
    max_rate_dps: float = setting(
        100.0, unit="deg/s", minimum=1.0, doc="A reading that is larger cannot be: a unit is wrong, or it was a jump."
    )
    keep_s: float = setting(60.0, unit="s", minimum=1.0, doc="Readings are kept for this long.")


class Gyro:
    """Takes inclinometer messages in the order of the log; `turned_at` tells how far the machine has turned since the first."""

    def __init__(self, settings: GyroSettings, R_base_sensor: FloatArray | None = None) -> None:
        """Args: `R_base_sensor`: how the sensor is mounted, shape (3, 3); None where its axes are the body's."""
        self._settings, self.warnings = settings, Warnings()
        self._R = np.eye(3) if R_base_sensor is None else np.asarray(R_base_sensor, dtype=float)
        self._samples = SampleBuffer("gyroscope", 2, settings.keep_s, self.warnings)
        self._rate_rps = math.nan
        self.impossible = self.taken = 0

    @property
    def there(self) -> bool:
        """Whether there is one."""
        return self.taken + self.impossible > 0

    def update(self, message: Inclination) -> None:
        """Take one message; without an angular velocity it says nothing."""
        if message.angular_velocity_rps is None or not self._settings.enabled:
            return
        rate_rps = self._heading_rate(message)
        if not abs(rate_rps) <= math.radians(self._settings.max_rate_dps):
            self.impossible += 1
            self._rate_rps = math.nan
            return
        before_ns, (turned, unknown_s) = self._samples.latest_ns, self._samples.latest_row or (0.0, 0.0)
        if before_ns is not None:
            dt_s = (message.stamp_ns - before_ns) * 1e-9
            middle_rps = 0.5 * (rate_rps + (self._rate_rps if math.isfinite(self._rate_rps) else rate_rps))
            turned, unknown_s = turned + middle_rps * dt_s, unknown_s + dt_s * (dt_s > self._settings.max_gap_s)
        if self._samples.append(message.stamp_ns, (turned, unknown_s)):
            self.taken += 1
            self._rate_rps = rate_rps

    def turned_at(self, times_ns: npt.NDArray[np.int64]) -> FloatArray:
        """Return turn (rad) and seconds of which it is not known (N, 2), both since the first reading; NaN beyond the readings."""
        stamps, rows = self._samples.stamps_ns, self._samples.rows
        if not len(stamps):
            return np.full((len(times_ns), 2), math.nan)
        at, x = (times_ns - stamps[0]).astype(float), (stamps - stamps[0]).astype(float)
        found = np.column_stack([np.interp(at, x, rows[:, 0]), np.interp(at, x, rows[:, 1])])
        found[(at < -1e9 * self._settings.max_gap_s) | (at > x[-1] + 1e9 * self._settings.max_gap_s)] = math.nan
        return found

    def _heading_rate(self, message: Inclination) -> float:
        """Return the rate of the heading, rad/s, NaN where a number is none; roll and pitch are those of the message."""
        rates = self._R @ np.asarray(message.angular_velocity_rps, dtype=float)
        roll, pitch = _body_angles(message, self._R)
        return float((math.sin(roll) * rates[1] + math.cos(roll) * rates[2]) / math.cos(pitch))


def _body_angles(message: Inclination, R_base_sensor: FloatArray) -> tuple[float, float]:
    """Return roll and pitch of the body from those of the sensor: of gravity's direction, turned into the body."""
    cp = math.cos(message.pitch_rad)
    down_sensor = [-math.sin(message.pitch_rad), math.sin(message.roll_rad) * cp, math.cos(message.roll_rad) * cp]
    x, y, z = (R_base_sensor @ np.array(down_sensor)).tolist()
    return math.atan2(y, z), math.atan2(-x, math.hypot(y, z))
