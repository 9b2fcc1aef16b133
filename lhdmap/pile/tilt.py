"""The mounting's tilt, checked against the floor: where the scanner saw it from afar, the machine stands later.

A hit on the floor that was computed too high by d at a range r says that the scanner looks down more than the mount says, or
that pitch or the path's rise are wrong: the angle d / r is all of them together, and just what bends a face that is climbed
scan by scan.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

_NEAREST_M = 8.0
_BOX_M = (0.5, 0.7)
_MOST_OFF_M = 0.35
_FEWEST_STEPS, _MOST_STEPS = 6, 80
_FLOOR_STD_M = 0.03  # floor between the wheels against that under them
_WARN_DEG = 0.15


class Tilt(NamedTuple):
    """How much lower than believed the scanner looks (rad), and its standard deviation."""

    angle_rad: float
    std_rad: float

    def warning(self) -> str | None:
        """Return what is to be said of the mounting, or None."""
        degrees, std = math.degrees(self.angle_rad), math.degrees(self.std_rad)
        if abs(degrees) < max(_WARN_DEG, 3.0 * std):
            return None
        return (
            f"the floor says that the scanner looks {abs(degrees):.2f}° {'lower' if degrees > 0 else 'higher'} than its mount "
            f"(± {std:.2f}°): correct its pitch by {degrees:+.2f}°"
        )


class TiltCheck:
    """Collects floor that was seen and then driven over."""

    def __init__(self, prior_std_rad: float) -> None:
        self._prior_std_rad = prior_std_rad
        self._steps: deque[tuple[float, float]] = deque(maxlen=_MOST_STEPS)

    def update(self, local: FloatArray, travelled_m: float) -> None:
        """Take the hits around `base_link`: rows x, y, z (m, its level frame, z = 0 on the floor), travelled (m)."""
        off, ranges = _floor_here(local, travelled_m)
        if off.size >= 3:
            self._steps.append((float(np.median(off)), float(np.median(ranges))))

    def tilt(self) -> Tilt:
        """Return the angle by weighted least squares over the steps, drawn to the mount by the prior."""
        if len(self._steps) < _FEWEST_STEPS:
            return Tilt(0.0, self._prior_std_rad)
        off, ranges = np.array(self._steps).T
        angle = float(np.median(off / ranges))
        kept = np.abs(off - angle * ranges) < 0.12
        if kept.sum() < _FEWEST_STEPS:
            return Tilt(0.0, self._prior_std_rad)
        information = (
            float((ranges[kept] ** 2).sum()) / _FLOOR_STD_M**2 / 4.0
        )  # the floor's waves: steps are not independent
        prior = 1.0 / self._prior_std_rad**2
        seen = float((off[kept] * ranges[kept]).sum() / (ranges[kept] ** 2).sum())
        return Tilt(information * seen / (information + prior), 1.0 / math.sqrt(information + prior))


@nb.njit(cache=True, nogil=True)
def _floor_here(local, travelled):  # type: ignore[no-untyped-def]
    """Return z of the hits that the machine stands on and that were seen from afar, and the ranges they were seen at."""
    off, ranges = np.empty(local.shape[0]), np.empty(local.shape[0])
    count = 0
    for i in range(local.shape[0]):
        x, y, z, ago = local[i, 0], local[i, 1], local[i, 2], travelled - local[i, 3]
        if abs(x) < _BOX_M[0] and abs(y) < _BOX_M[1] and abs(z) < _MOST_OFF_M and ago > _NEAREST_M:
            off[count], ranges[count] = z, ago + x
            count += 1
    return off[:count], ranges[:count]
