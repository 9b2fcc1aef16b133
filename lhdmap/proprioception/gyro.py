"""The turn of the machine from the gyroscope of its inclinometer: the heading's rate, added up.

Angular velocity (p, q, r) of the body, with its mount undone, turns the heading by (q sin(roll) + r cos(roll)) / cos(pitch): the
third row of the Euler rates (Titterton and Weston, *Strapdown Inertial Navigation Technology*, 3.6). Nothing is taken off here:
what a gyroscope is wrong by, only the scans can tell (`lhdmap.smoothing.heading`, `lhdmap.odometry.wheels.gyro`).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray, Inclination
from lhdmap.proprioception.attitude import NOISE_EVERY, THIRD_DIFFERENCE
from lhdmap.proprioception.samples import SampleBuffer, Warnings
from lhdmap.settings import setting

_MORE, _LEAST = 1.2, 0.25  # of the random walk: readings that were filtered look quieter than they are
_MOST_WALKS = 1000
_MOST_IMPOSSIBLE = 0.01
_KEEP_S = 60.0  # a scan waits for a second at most


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
        doc="Random walk of the angle where its readings do not tell it; a quarter of it is the least that is believed.",
    )
    bias_deg_h: float = setting(
        5.0,
        unit="deg/h",
        minimum=0.0,
        maximum=1e5,
        source="lhdmap: data sheets of calibrated industrial MEMS",
        doc="Constant part of its error, standard deviation; where the scans see a larger one, that is taken.",
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


class Gyro:
    """Takes inclinometer messages in the order of the log; `turned_at` tells how far the machine has turned since the first."""

    def __init__(self, settings: GyroSettings, lag_s: float, R_base_sensor: FloatArray | None = None) -> None:
        """Args: `lag_s`: of roll and pitch; `R_base_sensor`: mount, shape (3, 3); None where its axes are the body's."""
        self._settings, self.warnings = settings, Warnings()
        self._R = np.eye(3) if R_base_sensor is None else np.asarray(R_base_sensor, dtype=float)
        self._samples = SampleBuffer("gyroscope", 3, _KEEP_S, self.warnings)
        self._lag_ns, self._waiting = round(lag_s * 1e9), deque[tuple[int, FloatArray]]()
        self._rate_rps = math.nan
        self.impossible = self.taken = 0
        self._told_rps: float | None = None
        self._walks: deque[float] = deque(maxlen=_MOST_WALKS)  # rad/√s

    @property
    def there(self) -> bool:
        """Whether there is one."""
        return self.taken + self.impossible > 0

    def update(self, message: Inclination) -> None:
        """Take one message; without an angular velocity it says nothing."""
        if message.angular_velocity_rps is None or not self._settings.enabled:
            return
        self._told_rps = message.angular_velocity_std_rps
        # Roll and pitch come late: those of a message are of `lag` before it. With its own the rates of a rough floor add up.
        self._waiting.append((message.stamp_ns, self._R @ message.angular_velocity_rps))
        angles = _body_angles(message, self._R)
        while self._waiting and self._waiting[0][0] + self._lag_ns <= message.stamp_ns:
            stamp_ns, rates = self._waiting.popleft()
            self._add(stamp_ns, _heading_rate(rates, *angles))

    def _add(self, stamp_ns: int, rate_rps: float) -> None:
        if not abs(rate_rps) <= math.radians(self._settings.max_rate_dps):
            self.impossible += 1
            self._rate_rps = math.nan
            return
        before_ns, (turned, unknown_s, _) = self._samples.latest_ns, self._samples.latest_row or (0.0, 0.0, 0.0)
        if before_ns is not None:
            dt_s = (stamp_ns - before_ns) * 1e-9
            middle_rps = 0.5 * (rate_rps + (self._rate_rps if math.isfinite(self._rate_rps) else rate_rps))
            turned, unknown_s = turned + middle_rps * dt_s, unknown_s + dt_s * (dt_s > self._settings.max_gap_s)
        if self._samples.append(stamp_ns, (turned, unknown_s, rate_rps)):
            self.taken += 1
            self._rate_rps = rate_rps
            if self.taken % NOISE_EVERY == 0:
                self._learn_noise()

    @property
    def noise_deg_sqrt_h(self) -> float:
        """Random walk of its angle, as far as its messages or its readings tell: never a quarter of what is usual."""
        usual = self._settings.noise_deg_sqrt_h
        if not self._walks:
            return usual
        return max(_MORE * math.degrees(float(np.median(self._walks))) * 60.0, _LEAST * usual)

    def _learn_noise(self) -> None:
        """Take the readings' white noise over the last seconds for noise of the angle: what is slower is motion."""
        n = 4 * NOISE_EVERY
        stamps, rates = self._samples.stamps_ns[-n:], self._samples.rows[-n:, 2]
        period_s = float(np.median(np.diff(stamps))) * 1e-9
        white = 1.4826 * float(np.median(np.abs(np.diff(rates, n=3)))) / THIRD_DIFFERENCE
        self._walks.append((white if self._told_rps is None else self._told_rps) * math.sqrt(period_s))

    def texts(self) -> list[str]:
        """Return what was odd, in words."""
        told = self.warnings.texts()
        if self.impossible > _MOST_IMPOSSIBLE * (self.taken + self.impossible):
            most = f"{self._settings.max_rate_dps:g} deg/s"
            told.append(f"gyroscope: {self.impossible} readings of more than {most} were left out: is it in degrees?")
        return told

    def turned_at(self, times_ns: npt.NDArray[np.int64]) -> FloatArray:
        """Return turn (rad) and seconds of which it is not known (N, 2), both since the first reading; NaN beyond the readings."""
        stamps, rows = self._samples.stamps_ns, self._samples.rows
        if not len(stamps):
            return np.full((len(times_ns), 2), math.nan)
        first = max(
            int(np.searchsorted(stamps, times_ns.min())) - 1, 0
        )  # a scan asks for its own moment: no copy of all
        stamps, rows = stamps[first:], rows[first:]
        at, x = (times_ns - stamps[0]).astype(float), (stamps - stamps[0]).astype(float)
        found = np.column_stack([np.interp(at, x, rows[:, 0]), np.interp(at, x, rows[:, 1])])
        found[(at < -1e9 * self._settings.max_gap_s) | (at > x[-1] + 1e9 * self._settings.max_gap_s)] = math.nan
        return found

    def turn_between(self, first_ns: int, last_ns: int) -> float | None:
        """Return the turn (rad) from one time to a later one, None where it is not known."""
        before, after = self.turned_at(np.array([first_ns, last_ns]))
        known = math.isfinite(float(before[0] + after[0])) and after[1] - before[1] == 0.0
        return float(after[0] - before[0]) if known else None


def _heading_rate(rates_rps: FloatArray, roll: float, pitch: float) -> float:
    """Return the rate of the heading, rad/s, NaN where a number is none, from those of the body (3,) and its roll and pitch."""
    return float((math.sin(roll) * rates_rps[1] + math.cos(roll) * rates_rps[2]) / math.cos(pitch))


def _body_angles(message: Inclination, R_base_sensor: FloatArray) -> tuple[float, float]:
    """Return roll and pitch of the body from those of the sensor: of gravity's direction, turned into the body."""
    cp = math.cos(message.pitch_rad)
    down_sensor = [-math.sin(message.pitch_rad), math.sin(message.roll_rad) * cp, math.cos(message.roll_rad) * cp]
    x, y, z = (R_base_sensor @ np.array(down_sensor)).tolist()
    return math.atan2(y, z), math.atan2(-x, math.hypot(y, z))
