"""The skid factor, Eq. (7): how much faster the wheels turn than the machine moves."""

from __future__ import annotations

import math
from collections import deque

from lhdmap.loading.signals import Signals

_KEPT_NS = 1_000_000_000  # of the tachometer: more than any scan lags


class SkidFactor:
    """`skid = (v_T - v_L) / v_Mm`, v_Mm the largest of both speeds in a window of time; NaN where no scan has told a speed.

    The scan odometry lags behind: while the wheels speed up, Eq. (7) as printed shows that lag (finding E2, E3).
    `lag_matched` compares with the tachometer at the time of the scan.
    """

    def __init__(self, window_s: float, floor_mps: float, *, lag_matched: bool = False) -> None:
        self._window_ns, self._floor_mps, self._lag_matched = round(window_s * 1e9), floor_mps, lag_matched
        self._largest: deque[tuple[int, float]] = deque()  # falling values: the first is the window's largest
        self._wheels: deque[tuple[int, float]] = deque()
        self.wheels_mps = math.nan

    def update(self, signals: Signals) -> float:
        """Return the factor of now."""
        now_ns, wheels_mps, scan_mps = signals.now_ns, signals.tacho_mps, signals.scan_mps
        if self._lag_matched:
            self._keep(now_ns, wheels_mps)
            wheels_mps = self._wheels_at(signals.scan_ns)
        self.wheels_mps = wheels_mps
        speeds = [speed for speed in (wheels_mps, scan_mps) if math.isfinite(speed)]
        largest = self._window_largest(now_ns, max(speeds, default=0.0))
        return (wheels_mps - scan_mps) / max(largest, self._floor_mps)

    def _window_largest(self, now_ns: int, speed_mps: float) -> float:
        rows = self._largest
        while rows and rows[-1][1] <= speed_mps:
            rows.pop()
        rows.append((now_ns, speed_mps))
        while rows[0][0] < now_ns - self._window_ns:
            rows.popleft()
        return rows[0][1]

    def _keep(self, now_ns: int, speed_mps: float) -> None:
        if math.isfinite(speed_mps):
            self._wheels.append((now_ns, speed_mps))
        while self._wheels and self._wheels[0][0] < now_ns - _KEPT_NS:
            self._wheels.popleft()

    def _wheels_at(self, time_ns: int) -> float:
        """Return the tachometer at a time, on a line between its samples, held outside them."""
        after: tuple[int, float] | None = None
        for row in reversed(self._wheels):
            if row[0] <= time_ns:
                if after is None:
                    return row[1]
                share = (time_ns - row[0]) / (after[0] - row[0])
                return row[1] + share * (after[1] - row[1])
            after = row
        return after[1] if after is not None else math.nan
