"""Vibration of the front body by engine and road: a sum of tones, so that any moment of it is known without the ones before."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.history import Column

_TONES = 12
_BAND_HZ = (4.0, 9.0)
VIBRATION_DEG = 0.02
"""Standard deviation where nothing else is said, as in the drift scenario."""


class Shaking:
    """Roll and pitch (rad) that are added at any time; `size_rad` is their standard deviation."""

    def __init__(self, size_rad: float, seed: int) -> None:
        rng = np.random.default_rng([seed, 6])
        self._omega = 2 * math.pi * rng.uniform(*_BAND_HZ, (2, _TONES))
        self._phase = rng.uniform(0.0, 2 * math.pi, (2, _TONES))
        self._amplitude = size_rad * math.sqrt(2.0 / _TONES)

    def at(self, time_s: float) -> FloatArray:
        """Return roll and pitch, shape (2,)."""
        angles: FloatArray = self._amplitude * np.sin(self._omega * time_s + self._phase).sum(axis=1)
        return angles

    def onto(self, row: FloatArray, time_s: float) -> FloatArray:
        """Return a row (20,) of a `History` with it; the row is changed."""
        row[[Column.ROLL, Column.PITCH]] += self.at(time_s)
        return row
