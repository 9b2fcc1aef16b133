"""The machine's own dead reckoning (`nav_msgs/Odometry`, CARMEN's ODOM): differences of its poses."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, WheelPose
from lhdmap.proprioception.samples import SampleBuffer, Warnings

EXACT_KEPT = 1024
_PERIOD_SHARE = 0.02
_SPEED_LASTS_S, _SHORTEST_S = 0.6, 0.01


class ReckoningLimits(NamedTuple):
    """What is believed: speed and jump from pose to pose, the gap that is interpolated, the time one is carried on."""

    max_speed_mps: float
    max_jump_m: float
    max_gap_ns: int
    max_hold_ns: int


class ReckonedStep(NamedTuple):
    """Motion in the frame at its start, `delta` (3,): x, y, heading; and the fastest of the last moments.

    A pose that is late by a moment is off by what was driven in it: where a machine stops, that does not show in the motion.
    """

    delta: FloatArray
    speed_mps: float
    turn_rps: float


class DeadReckoning:
    """Keeps wheel poses and gives the motion between two times.

    A pose with just the wanted stamp is used as it is, also in logs whose stamps run backwards (those of old CARMEN
    loggers do, by half a second each second); otherwise the poses around a time are interpolated. How long the time
    between two poses is does not matter: dead reckoning goes on unseen. Across a jump there is no motion.
    """

    def __init__(self, limits: ReckoningLimits, keep_s: float, warnings: Warnings) -> None:
        self.limits = limits
        self.warnings = warnings
        self.samples = SampleBuffer(
            "wheel odometry", 6, keep_s, warnings
        )  # x, y, heading, number of the stretch, speeds
        self._exact: OrderedDict[int, FloatArray] = OrderedDict()
        self._last: WheelPose | None = None
        self._stretch = 0
        self._period_s = 0.0  # mean over some fifty: also where poses come in bunches, with stamps of delivery
        self._speeds = (0.0, 0.0)

    def update(self, message: WheelPose) -> None:
        """Take one pose."""
        if not all(map(math.isfinite, (message.x_m, message.y_m, message.heading_rad))):
            self.warnings.add("wheel odometry: a sample is not finite; left out")
            return
        if self._last is not None:
            if self._jumps(self._last, message):
                self._stretch += 1
                self.warnings.add("wheel odometry: it jumps; no motion is taken across the jump")
            else:
                self._speeds = self._fastest(self._last, message)
        self._last = message
        row = (message.x_m, message.y_m, message.heading_rad, float(self._stretch), *self._speeds)
        self.samples.append(message.stamp_ns, row)
        self._exact[message.stamp_ns] = np.array(row)
        self._exact.move_to_end(message.stamp_ns)
        if len(self._exact) > EXACT_KEPT:
            self._exact.popitem(last=False)

    def step_between(self, start_ns: int, end_ns: int) -> ReckonedStep | None:
        """Return the motion between two times, or None where it is not known."""
        start, end = self._pose_at(start_ns), self._pose_at(end_ns)
        if start is None or end is None or start[3] != end[3]:
            return None
        return ReckonedStep(np.asarray(se2.between(start[:3], end[:3])), float(end[4]), float(end[5]))

    def _fastest(self, last: WheelPose, message: WheelPose) -> tuple[float, float]:
        """Return the larger of the speed (m/s) and turn rate (rad/s) of a step and what is left of those before it."""
        dt_s = (message.stamp_ns - last.stamp_ns) * 1e-9
        self._period_s += _PERIOD_SHARE * (dt_s - self._period_s)
        elapsed_s = max(dt_s, self._period_s, _SHORTEST_S)
        kept = math.exp(-elapsed_s / _SPEED_LASTS_S)
        moved_m = math.hypot(message.x_m - last.x_m, message.y_m - last.y_m)
        turned_rad = abs(se2.wrap(message.heading_rad - last.heading_rad))
        return max(moved_m / elapsed_s, kept * self._speeds[0]), max(turned_rad / elapsed_s, kept * self._speeds[1])

    def _jumps(self, last: WheelPose, message: WheelPose) -> bool:
        moved_m = math.hypot(message.x_m - last.x_m, message.y_m - last.y_m)
        elapsed_s = abs(message.stamp_ns - last.stamp_ns) / 1e9
        return moved_m > self.limits.max_jump_m + self.limits.max_speed_mps * elapsed_s

    def _pose_at(self, stamp_ns: int) -> FloatArray | None:
        """Return the row of samples at a time; after the last pose the last motion is carried on; shape (6,)."""
        exact = self._exact.get(stamp_ns)
        if exact is not None:
            return exact
        stamps, rows = self.samples.stamps_ns, self.samples.rows
        if len(stamps) < 2 or stamp_ns < stamps[0] or stamp_ns > stamps[-1] + self.limits.max_hold_ns:
            return None
        after = min(int(np.searchsorted(stamps, stamp_ns)), len(stamps) - 1)
        before, following = rows[after - 1], rows[after]
        width_ns = int(stamps[after] - stamps[after - 1])
        if before[3] != following[3] or width_ns > self.limits.max_gap_ns:
            return None
        step = following - before
        step[2] = se2.wrap(step[2])
        return np.asarray(before + (stamp_ns - stamps[after - 1]) / width_ns * step)
