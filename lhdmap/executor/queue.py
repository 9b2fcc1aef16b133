"""The queue of commands: time-stamped, later plans override earlier ones from their first setpoint on (Fig. 11)."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from lhdmap.driving.motion import Setpoint
from lhdmap.messages import FloatArray


class CommandQueue:
    """Setpoints in time order; `at_ns` of a setpoint is when the command is given, not when the machine follows.

    Values are interpolated linearly: held between setpoints that are not given at the rate of the plan, they would
    make saw teeth (guidance findings, trap 4).
    """

    def __init__(self) -> None:
        self._points: list[Setpoint] = []

    def __len__(self) -> int:
        return len(self._points)

    def insert(self, setpoints: Sequence[Setpoint]) -> None:
        """Take a plan: what was queued from the time of its first setpoint on is erased.

        Raises:
            ValueError: a value is not finite, or the times do not rise; the queue is as it was.
        """
        if any(not (math.isfinite(one.speed_mps) and math.isfinite(one.steering_rate_rps)) for one in setpoints):
            raise ValueError("a setpoint is not finite")
        if any(after.at_ns <= before.at_ns for before, after in pairwise(setpoints)):
            raise ValueError("setpoints are not in the order of time")
        if setpoints:
            del self._points[bisect_left(self._points, setpoints[0].at_ns, key=_time) :]
            self._points.extend(setpoints)

    def clear(self) -> None:
        """Erase all."""
        self._points.clear()

    def forget(self, now_ns: int) -> None:
        """Drop setpoints of the past, but for the last of them, from which values are interpolated."""
        del self._points[: max(bisect_right(self._points, now_ns, key=_time) - 1, 0)]

    def at(self, now_ns: int) -> Setpoint | None:
        """Return what is to be done now; None before the first setpoint and after the last: nothing is planned then."""
        k = bisect_right(self._points, now_ns, key=_time)
        if k == 0:
            return None
        before = self._points[k - 1]
        if k == len(self._points):
            return before if before.at_ns == now_ns else None
        after = self._points[k]
        share = (now_ns - before.at_ns) / (after.at_ns - before.at_ns)
        return Setpoint(
            now_ns,
            before.speed_mps + share * (after.speed_mps - before.speed_mps),
            before.steering_rate_rps + share * (after.steering_rate_rps - before.steering_rate_rps),
        )

    def slope_mps2(self, now_ns: int) -> float:
        """Return how the speed changes now, m/s2; 0 where nothing is planned."""
        k = bisect_right(self._points, now_ns, key=_time)
        if k in (0, len(self._points)):
            return 0.0
        before, after = self._points[k - 1], self._points[k]
        return (after.speed_mps - before.speed_mps) / ((after.at_ns - before.at_ns) * 1e-9)

    def rest_m(self, now_ns: int) -> float:
        """Return the way that is planned until the machine stands, m; infinite where it is not to stand."""
        now = self.at(now_ns)
        if now is None:
            return 0.0
        way, before = 0.0, now
        for after in self._points[bisect_right(self._points, now_ns, key=_time) :]:
            if before.speed_mps == 0.0:
                break
            way += 0.5 * abs(before.speed_mps + after.speed_mps) * (after.at_ns - before.at_ns) * 1e-9
            before = after
        return way if before.speed_mps == 0.0 else math.inf

    def left_s(self, now_ns: int) -> float:
        """Return `Q_dt` of Eq. (20): how long what is queued lasts, s."""
        return max((self._points[-1].at_ns - now_ns) * 1e-9, 0.0) if self._points else 0.0

    def rows(self, from_ns: int, zero_ns: int) -> FloatArray:
        """Return time since `zero_ns` (s), speed and rate at `from_ns` and of all setpoints after it, shape (K, 3)."""
        now = self.at(from_ns)
        later = self._points[bisect_right(self._points, from_ns, key=_time) :]
        points = later if now is None else [now, *later]
        rows = [((one.at_ns - zero_ns) * 1e-9, one.speed_mps, one.steering_rate_rps) for one in points]
        return np.array(rows).reshape(-1, 3)


def _time(point: Setpoint) -> int:
    return point.at_ns
