"""Whether the joint follows what it is told: the angle that commands should have brought about against the measured one.

A joint that is stuck leaves the path, and the guard, which predicts with the joint's measured rate, learns of it too late. Gains,
lags and a dead time that are a little other than the model's stay well below the limit (`tests/executor/test_joint.py`).
"""

from __future__ import annotations

import math
from collections import deque

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion

_WINDOW_NS = 800_000_000
_STOP_RAD = math.radians(1.0)  # so near its stop the joint may rest


class JointWatch:
    """Takes commands and motions; `apart_rad` is by how much the joint has missed its commands in the last 0.8 s, signed."""

    def __init__(self, model: DriveModel) -> None:
        self.model, self.apart_rad = model, 0.0
        self._given: deque[tuple[int, float]] = deque()
        self._rate_rps = self._told_rps = self._bend_rad = 0.0
        self._last_ns: int | None = None
        self._rows: deque[tuple[int, float]] = deque()

    def gave(self, now_ns: int, rate_rps: float) -> None:
        """Take a command: rate of the joint."""
        self._given.append((now_ns + round(self.model.dead_time_s * 1e9), rate_rps))

    def sees(self, motion: Motion) -> float:
        """Take a motion, where it is newer than the last one; return by how much the joint is off, rad."""
        last = self._last_ns
        if last is None or motion.stamp_ns - last > _WINDOW_NS:
            self._restart(motion)
        elif motion.stamp_ns > last:
            self._expect(last, motion.stamp_ns, motion.articulation_rad)
            self._last_ns = motion.stamp_ns
            self._rows.append((motion.stamp_ns, motion.articulation_rad - self._bend_rad))
            while motion.stamp_ns - self._rows[0][0] > _WINDOW_NS:
                self._rows.popleft()
            self.apart_rad = self._rows[-1][1] - self._rows[0][1]
        return self.apart_rad

    def _restart(self, motion: Motion) -> None:
        self._last_ns, self._rate_rps, self._bend_rad = motion.stamp_ns, motion.articulation_rate_rps, 0.0
        self._rows.clear()
        self._rows.append((motion.stamp_ns, motion.articulation_rad))
        self.apart_rad = 0.0

    def _expect(self, from_ns: int, to_ns: int, measured_rad: float) -> None:
        """Move the expected angle on: rate with its lag, none into the stop."""
        while self._given and self._given[0][0] <= to_ns:
            self._told_rps = self._given.popleft()[1]
        step_s = (to_ns - from_ns) * 1e-9
        self._rate_rps += (self._told_rps - self._rate_rps) * -math.expm1(-step_s / self.model.steering_lag_s)
        rests = abs(measured_rad) > self.model.max_articulation_rad - _STOP_RAD and measured_rad * self._rate_rps > 0.0
        self._bend_rad += 0.0 if rests else self._rate_rps * step_s
