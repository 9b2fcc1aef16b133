"""How late something is: a histogram with bins of 2 %, so that a day costs as much memory as a minute."""

from __future__ import annotations

import math

import numpy as np

_LEAST_MS, _GROWTH, _BINS = 0.01, 1.02, 900  # up to 0.01 ms * 1.02^900 = 9 minutes


class Latency:
    """Takes latencies in milliseconds; tells their median, quantiles and maximum."""

    def __init__(self) -> None:
        self._bins = np.zeros(_BINS, dtype=np.int64)
        self.max_ms = 0.0
        self.last_ms = math.nan

    def add(self, value_ms: float) -> None:
        """Take one; a negative one (the sender's clock is ahead) counts as none."""
        self.last_ms = value_ms
        self.max_ms = max(self.max_ms, value_ms)
        place = math.log(max(value_ms, _LEAST_MS) / _LEAST_MS) / math.log(_GROWTH)
        self._bins[min(int(place), _BINS - 1)] += 1

    @property
    def count(self) -> int:
        """How many were taken."""
        return int(self._bins.sum())

    def quantile_ms(self, share: float) -> float | None:
        """Return the latency that this share does not exceed, to 2 %; None where there is none."""
        if not self.count:
            return None
        place = int(np.searchsorted(np.cumsum(self._bins), math.ceil(share * self.count)))
        return float(min(_LEAST_MS * _GROWTH ** (place + 1), self.max_ms))

    def to_json(self) -> dict[str, float | int | None]:
        """Return the figures."""
        biggest = self.max_ms if self.count else None
        return {
            "count": self.count,
            "median_ms": self.quantile_ms(0.5),
            "p99_ms": self.quantile_ms(0.99),
            "max_ms": biggest,
        }
