"""What walls said for and against a sensor: lately, which decides whether it is believed, and in all, which a user is told."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

_MOST_RATIOS = 500  # that the median of a warning is taken of: memory is bounded


class WordOfWalls:
    """`take` each comparison with its size (m driven, or rad turned), which is also what it counts for."""

    def __init__(self, memory: float) -> None:
        """`memory`: what counts as lately, in the unit of the sizes."""
        self.lately_for = self.lately_against = self.compared = self.against = 0.0
        self._memory = memory
        self._ratios: deque[float] = deque(maxlen=_MOST_RATIOS)

    def take(self, size: float, ratio: float, *, agrees: bool) -> None:
        """Take a comparison: what the sensor said over what the walls said (nan: unknown), and whether that agrees."""
        keep = math.exp(-size / self._memory)
        self.lately_for = keep * self.lately_for + size * agrees
        self.lately_against = keep * self.lately_against + size * (not agrees)
        self.compared += size
        self.against += size * (not agrees)
        if not agrees and not math.isnan(ratio):
            self._ratios.append(ratio)

    def ratio(self) -> float:
        """Return the usual ratio of the comparisons that did not agree, nan where none has one."""
        return float(np.median(self._ratios)) if self._ratios else math.nan
