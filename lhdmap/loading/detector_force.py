"""What is pushed against: the force at the tyres less what the machine needs to roll and to speed up, and its sum."""

from __future__ import annotations

import math
from collections import deque

from lhdmap.loading.signals import Signals


class LineSlope:
    """Slope of the line through the samples of the last `window_s`: an acceleration out of speeds; 0 with too few."""

    def __init__(self, window_s: float) -> None:
        self._window_ns = round(window_s * 1e9)
        self._rows: deque[tuple[int, float]] = deque()

    def update(self, now_ns: int, value: float) -> float:
        """Return the slope with this sample, per second."""
        if math.isfinite(value):
            self._rows.append((now_ns, value))
        while self._rows and self._rows[0][0] < now_ns - self._window_ns:
            self._rows.popleft()
        return self._slope() if len(self._rows) > 2 else 0.0

    def _slope(self) -> float:
        count, first_ns = len(self._rows), self._rows[0][0]
        t = v = tt = tv = 0.0
        for stamp_ns, value in self._rows:
            at = (stamp_ns - first_ns) * 1e-9
            t, v, tt, tv = t + at, v + value, tt + at * at, tv + at * value
        below = count * tt - t * t
        return (count * tv - t * v) / below if below > 0.0 else 0.0


class Cusum:
    """One-sided cumulative sum (Page): `S = max(0, S + (x - free) dt)`; a change is told where S exceeds `limit`.

    `since_ns` is when S left zero for the last time: the likeliest moment of the change.
    """

    def __init__(self, free: float, limit: float) -> None:
        self._free, self._limit = free, limit
        self.sum, self.since_ns, self._last_ns = 0.0, 0, 0

    def update(self, now_ns: int, value: float) -> bool:
        """Return whether the change is told, with a sample that holds since the one before; NaN adds nothing."""
        dt_s = (now_ns - self._last_ns) * 1e-9 if self._last_ns else 0.0
        self._last_ns = now_ns
        if math.isfinite(value):
            if self.sum <= 0.0:
                self.since_ns = now_ns
            self.sum = max(0.0, self.sum + (value - self._free) * dt_s)
        return self.sum > self._limit

    def reset(self) -> None:
        """Forget the sum."""
        self.sum = 0.0


class ForceResidual:
    """`F = k p - m a - R`, kN: what pushes back, by the pressure of the transmission and the slope of the tachometer."""

    def __init__(self, kn_per_bar: float, mass_t: float, rolling_kn: float, slope_s: float) -> None:
        self._kn_per_bar, self._mass_t, self._rolling_kn = kn_per_bar, mass_t, rolling_kn
        self._acceleration = LineSlope(slope_s)

    def update(self, signals: Signals) -> float:
        """Return the force of now; NaN without a pressure."""
        acceleration_mps2 = self._acceleration.update(signals.now_ns, signals.tacho_mps)
        return self._kn_per_bar * signals.transmission_bar - self._mass_t * acceleration_mps2 - self._rolling_kn
