"""The drift ahead of the machine: its walls followed from the machine on, so that what closes it can be told from them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

BIN_M = 0.5
_FIRST_M = 2.0
_USUAL_HALF_M = 2.0
_LOW_M, _HIGH_M = -1.5, 4.0  # heights over the machine's floor that walls are looked for in: the drift may climb
_FEWEST = 4


class Corridor(NamedTuple):
    """Walls by distance ahead, local frame (x forward, y left); arrays (K,): NaN where a wall was not seen.

    `x_m` middles of the bins, `centre_m`, `left_m`, `right_m` y of middle line and walls.
    """

    x_m: FloatArray
    centre_m: FloatArray
    left_m: FloatArray
    right_m: FloatArray

    def centre_at(self, x_m: FloatArray) -> FloatArray:
        """Return y of the middle line at x, shape of x."""
        return np.interp(x_m, self.x_m, self.centre_m)

    def half_at(self, x_m: FloatArray) -> FloatArray:
        """Return half the width at x."""
        half = 0.5 * (self.left_m - self.right_m)
        known = np.isfinite(half)
        if not known.any():
            return np.full_like(x_m, _USUAL_HALF_M)
        return np.interp(x_m, self.x_m[known], half[known])


def trace(points: FloatArray, reach_m: float) -> Corridor:
    """Follow the walls through points (N, 3+), local frame, up to `reach_m` ahead."""
    count = max(int((reach_m - _FIRST_M) / BIN_M), 1)
    x = points[:, 0]
    use = (x > _FIRST_M) & (x < _FIRST_M + count * BIN_M) & (points[:, 2] > _LOW_M) & (points[:, 2] < _HIGH_M)
    chosen = points[use]
    bins = ((chosen[:, 0] - _FIRST_M) / BIN_M).astype(np.int64)
    order = np.argsort(bins, kind="stable")
    starts = np.searchsorted(bins[order], np.arange(count + 1))
    out = np.full((count, 3), math.nan)
    _follow(np.ascontiguousarray(chosen[order, 1]), starts, out)
    middles: FloatArray = _FIRST_M + (np.arange(count, dtype=np.float64) + 0.5) * BIN_M
    return Corridor(middles, out[:, 0], out[:, 1], out[:, 2])


@nb.njit(cache=True)
def _side(values, predicted):  # type: ignore[no-untyped-def]
    """Return where the wall is among distances to its side, NaN where there are few near the prediction.

    Floor and rubble lie before the wall: it is the outermost that many hits agree on.
    """
    near = values[np.abs(values - predicted) < 0.8]
    if near.size < _FEWEST:
        return math.nan
    outer = np.percentile(near, 85.0)
    return float(np.median(near[np.abs(near - outer) < 0.3]))


@nb.njit(cache=True)
def _follow(y, starts, out):  # type: ignore[no-untyped-def]
    """Fill rows centre, left, right: each wall is predicted from the bins before, a missing one from the other and the width."""
    centre, half, slope = 0.0, _USUAL_HALF_M, 0.0
    known = 0
    for k in range(out.shape[0]):
        values = y[starts[k] : starts[k + 1]]
        centre += slope
        left, right = _side(values, centre + half), -_side(-values, half - centre)
        if known < 4:  # the machine may stand anywhere between the walls
            above, below = values[values > 0.6], values[values < -0.6]
            if above.size >= _FEWEST and below.size >= _FEWEST:
                left, right = _side(above, np.median(above)), -_side(-below, np.median(-below))
        both = not (math.isnan(left) or math.isnan(right))
        if both:
            found = 0.5 * (left + right)
            half += 0.3 * (0.5 * (left - right) - half) if known else 0.5 * (left - right) - half
            gain = 0.5 if known else 1.0
        elif not math.isnan(left):
            found, gain = left - half, 0.3
        elif not math.isnan(right):
            found, gain = right + half, 0.3
        else:
            found, gain = centre, 0.0
        if known > 2:
            slope += 0.15 * gain * (found - centre)
        centre += gain * (found - centre)
        known += both
        out[k, 0], out[k, 1], out[k, 2] = centre, left, right
