"""The drift ahead of the machine: its walls followed from the machine on, so that what closes it can be told from them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.order import grouped, quantile

BIN_M = 0.5
_FIRST_M = 2.0
_USUAL_HALF_M = 2.0
_LOW_M, _HIGH_M = -1.5, 4.0  # heights over the machine's floor that walls are looked for in: the drift may climb
_FEWEST = 4


class DriftCorridor(NamedTuple):
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

    def inside(self, points: FloatArray, gap_m: float) -> FloatArray:
        """Return the points (N, 3+) between the walls and farther from them than a gap."""
        return _within(points, self.x_m, self.centre_m, self.half_at(self.x_m) - gap_m)


def trace(points: FloatArray, reach_m: float) -> DriftCorridor:
    """Follow the walls through points (N, 3+), local frame, up to `reach_m` ahead."""
    count = max(int((reach_m - _FIRST_M) / BIN_M), 1)
    out = np.full((count, 3), math.nan)
    y, starts = _in_bins(points, count)
    _follow(y, starts, out)
    middles: FloatArray = _FIRST_M + (np.arange(count, dtype=np.float64) + 0.5) * BIN_M
    return DriftCorridor(middles, out[:, 0], out[:, 1], out[:, 2])


@nb.njit(cache=True, nogil=True)
def _in_bins(points, count):  # type: ignore[no-untyped-def]
    """Return y of the points at the height of walls, by bin along x, and where each bin begins."""
    y, bins = np.empty(points.shape[0]), np.empty(points.shape[0], np.int64)
    used = 0
    for i in range(points.shape[0]):
        x, z = points[i, 0], points[i, 2]
        if x > _FIRST_M and x < _FIRST_M + count * BIN_M and z > _LOW_M and z < _HIGH_M:
            y[used], bins[used] = points[i, 1], min(int((x - _FIRST_M) / BIN_M), count - 1)
            used += 1
    return grouped(y[:used], bins[:used], count)


@nb.njit(cache=True, nogil=True)
def _within(points, x_m, centre, half):  # type: ignore[no-untyped-def]
    """Return the points nearer than `half` to the middle line; both (K,) are known at bins x_m, straight between, level beyond."""
    out = np.empty_like(points)
    used, last = 0, x_m.size - 1
    for i in range(points.shape[0]):
        at = min(max((points[i, 0] - x_m[0]) / BIN_M, 0.0), float(last))
        k = min(int(at), max(last - 1, 0))
        to = min(k + 1, last)
        middle = centre[k] + (at - k) * (centre[to] - centre[k])
        if abs(points[i, 1] - middle) < half[k] + (at - k) * (half[to] - half[k]):
            out[used] = points[i]
            used += 1
    return out[:used]


@nb.njit(cache=True, nogil=True)
def _side(values, side, predicted, scratch):  # type: ignore[no-untyped-def]
    """Return where the wall is among distances to its side, NaN where there are few near the prediction.

    Floor and rubble lie before the wall: it is the outermost that many hits agree on.
    """
    near = 0
    for y in values:
        if abs(side * y - predicted) < 0.8:
            scratch[near] = side * y
            near += 1
    if near < _FEWEST:
        return math.nan
    outer = quantile(scratch, near, 0.85)
    agree = 0
    for i in range(near):
        if abs(scratch[i] - outer) < 0.3:
            scratch[agree] = scratch[i]
            agree += 1
    return quantile(scratch, agree, 0.5) if agree else math.nan


@nb.njit(cache=True, nogil=True)
def _begin(values, side, scratch):  # type: ignore[no-untyped-def]
    """Return whether enough hits are clear of the middle, and where the wall is, wherever the machine stands between the walls."""
    clear, count = np.empty(values.size), 0
    for y in values:
        if side * y > 0.6:
            clear[count] = side * y
            count += 1
    if count < _FEWEST:
        return False, math.nan
    return True, _side(clear[:count], 1.0, quantile(clear, count, 0.5), scratch)


@nb.njit(cache=True, nogil=True)
def _follow(y, starts, out):  # type: ignore[no-untyped-def]
    """Fill rows centre, left, right: each wall is predicted from the bins before, a missing one from the other and the width."""
    centre, half, slope = 0.0, _USUAL_HALF_M, 0.0
    known = 0
    scratch = np.empty(y.size)
    for k in range(out.shape[0]):
        values = y[starts[k] : starts[k + 1]]
        centre += slope
        left, right = _side(values, 1.0, centre + half, scratch), -_side(values, -1.0, half - centre, scratch)
        if known < 4:  # the machine may stand anywhere between the walls
            above, below = _begin(values, 1.0, scratch), _begin(values, -1.0, scratch)
            if above[0] and below[0]:
                left, right = above[1], -below[1]
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
