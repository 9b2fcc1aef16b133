"""Wheels and walls beside each other over a stretch: long enough that it does not matter that wheels come late."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray

_STRETCH_RAD = 0.6  # a turn also ends a stretch: half a right angle is far more than wheels are late


class Compared(NamedTuple):
    """Forward distance (m) and turn (rad) of one stretch: by wheels, with the variance of their turn (rad²), and by walls.

    `length_m`: what was driven by the walls, forward and back.
    """

    wheels_m: float
    wheels_rad: float
    variance: float
    walls_m: float
    walls_rad: float
    length_m: float


class WheelStretch:
    """`measured` with each step of the wheels, `matched` with each pose that the walls gave; `missed` where either failed."""

    def __init__(self, length_m: float = 1.0) -> None:
        self._length_m = length_m
        self._last: FloatArray | None = None
        self._restart()

    def measured(self, forward_m: float, turn_rad: float = 0.0, sigma_rad: float = 0.0) -> None:
        """Take a step of the wheels."""
        self._wheels += np.array([forward_m, turn_rad, sigma_rad**2])
        self._turned_m += abs(forward_m)

    def missed(self) -> None:
        """Begin anew with the next match."""
        self._last = None

    def matched(self, pose: FloatArray) -> Compared | None:
        """Take the pose (3,) at the end of the step measured last; return what was compared once a stretch is over."""
        if self._last is None:
            self._restart()
        else:
            step = se2.between(self._last, pose)
            self._walls += np.array([step[0], step[2], abs(step[0])])
        self._last = pose
        if max(self._walls[2], self._turned_m) < self._length_m and abs(self._walls[1]) < _STRETCH_RAD:
            return None
        done = Compared(*self._wheels.tolist(), *self._walls.tolist())
        self._restart()
        return done

    def _restart(self) -> None:
        self._wheels, self._walls, self._turned_m = np.zeros(3), np.zeros(3), 0.0
