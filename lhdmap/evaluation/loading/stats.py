"""Mean with its 95 % interval, median, number: of values of which some are not known."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from lhdmap.evaluation.loading.loads import known
from lhdmap.loading.calibrate import student_95


class Stat(NamedTuple):
    """`n` values that are known, their mean, deviation (of a sample), median, and the half width of the mean's 95 % interval."""

    n: int
    mean: float
    std: float
    median: float
    mean_95: float

    def to_json(self) -> dict[str, Any]:
        """Return the figures for JSON; the interval as its two ends."""
        low, high = known(self.mean - self.mean_95), known(self.mean + self.mean_95)
        interval = None if low is None or high is None else [low, high]
        figures = {"mean": known(self.mean), "std": known(self.std), "median": known(self.median)}
        return {"n": self.n, **figures, "mean_95": interval}


def stat_of(values: Iterable[float]) -> Stat:
    """Return the figures of values; NaN among them are left out. The interval is Student's; of one value there is none."""
    chosen = np.array([value for value in values if math.isfinite(value)], dtype=float)
    if not len(chosen):
        return Stat(0, math.nan, math.nan, math.nan, math.nan)
    mean, median = float(chosen.mean()), float(np.median(chosen))
    if len(chosen) < 2:
        return Stat(1, mean, math.nan, median, math.nan)
    std = float(chosen.std(ddof=1))
    return Stat(len(chosen), mean, std, median, student_95(len(chosen) - 1) * std / math.sqrt(len(chosen)))
