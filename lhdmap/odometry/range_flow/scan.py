"""A scan prepared for range flow: local least squares ranges and gradients, and which neighbours share a wall."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

JUMP_SLOPE = 14.0  # neighbours whose line to each other is steeper than this against the beam do not share a wall
_MOST_NEIGHBOURS = 24  # to each side that a line is fitted to: bounds the time where walls are near and dense
_FEWEST_BEAMS = 20  # of a coarse level: with fewer there are no lines
_GAP_SPACINGS, _STEP_M = (
    2.6,
    0.05,
)  # two beams missing at most, and a jump of the range that is only noise, within one wall
_FIRST_WEIGHT = 0.2  # at least, of the two neighbours: where walls are sparse they still give the slope
_LEAST_SPREAD_M2 = 1e-10  # of hits across the beam: with less they are one point

# Columns of a level, an array of shape (N, 6) with beams in rising angle. X, Y: the beam's end at its local least squares
# range, metres about the scanner; SLOPE: dR/dtheta / R of the wall there (0: no wall line); GAIN: variance of that slope
# for a range noise of 1 m; BEND: mean square of the hits about that line, m²; WALL: 1 where beams i and i + 1 see the same
# wall and both have its line.
X, Y, SLOPE, GAIN, BEND, WALL = range(6)
_COLUMNS = 6  # their number


class Pyramid:
    """A scan's levels; level k keeps every 2^k-th beam and fits lines 2^k times as wide.

    `points_m`: hits, shape (N, 2) or more columns, about the scanner. They are put in the order of their angle; any order,
    offset and spacing of the beams will do. The finest level is made at once, the others when they are asked for: most
    comparisons are near enough not to need them.
    """

    def __init__(self, points_m: FloatArray, width_m: float, levels: int) -> None:
        if not _in_order(points_m):
            points_m = points_m[np.argsort(np.arctan2(points_m[:, 1], points_m[:, 0]), kind="stable")]
        self._points, self._width_m = points_m, width_m
        self._levels: dict[int, FloatArray] = {0: _prepare(points_m, 1, width_m)}
        self.coarsest = 0
        while self.coarsest < levels - 1 and len(points_m) >> (self.coarsest + 1) >= _FEWEST_BEAMS:
            self.coarsest += 1

    def level(self, level: int) -> FloatArray:
        """Return one level, 0 the finest: shape (N, 6), columns as above."""
        if level not in self._levels:
            stride = 1 << level
            self._levels[level] = _prepare(self._points, stride, self._width_m * stride)
        return self._levels[level]


@nb.njit(cache=True, nogil=True)
def _in_order(points):  # type: ignore[no-untyped-def]
    """Return whether the angles of points (N, 2+) rise from -pi to pi; without computing them."""
    for i in range(points.shape[0] - 1):
        x, y, next_x, next_y = points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1]
        half, next_half = y >= 0.0, next_y >= 0.0
        if half > next_half or (half == next_half and x * next_y - y * next_x < 0.0):
            return False
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _prepare(points, stride, width_m):  # type: ignore[no-untyped-def]
    """Return a level, shape (N, 6), from every `stride`-th of points (M, 2+) in the order of their angle."""
    n = (points.shape[0] + stride - 1) // stride
    x, y, r = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        x[i], y[i] = points[i * stride, 0], points[i * stride, 1]
        r[i] = max(math.sqrt(x[i] * x[i] + y[i] * y[i]), 1e-6)
    joined = _joined(x, y, r)
    level = np.empty((n, _COLUMNS))
    _fit_lines(x, y, r, _moments(x, y, joined, width_m), level)
    for i in range(n):
        both = joined[i] and level[i, SLOPE] != 0.0 and level[i + 1, SLOPE] != 0.0
        level[i, WALL] = 1.0 if both else 0.0
    return level


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _joined(x, y, r):  # type: ignore[no-untyped-def]
    """Return (N,) whether beams i and i + 1 see the same wall: no beam is missing between them, and no jump of the range."""
    n = x.size
    gap = np.empty(n)
    for i in range(n - 1):
        sine = (x[i] * y[i + 1] - y[i] * x[i + 1]) / (r[i] * r[i + 1])
        gap[i] = sine if x[i] * x[i + 1] + y[i] * y[i + 1] > 0.0 else math.pi
    spacing = _spacing(gap[: n - 1])
    joined = np.zeros(n, dtype=np.bool_)
    for i in range(n - 1):
        step = abs(r[i + 1] - r[i])
        joined[i] = gap[i] < _GAP_SPACINGS * spacing and step < JUMP_SLOPE * min(r[i], r[i + 1]) * gap[i] + _STEP_M
    return joined


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _spacing(gap):  # type: ignore[no-untyped-def]
    """Return the usual angle between neighbours: the mean of the gaps that no missing beam has widened."""
    limit, mean = math.inf, 1.0
    for _ in range(3):
        total, count = 0.0, 0
        for i in range(gap.size):
            small = gap[i] <= limit
            total += gap[i] if small else 0.0
            count += small
        mean = total / count if count else mean
        limit = 1.5 * mean
    return mean


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _moments(x, y, joined, width_m):  # type: ignore[no-untyped-def]
    """Return weight, first and second moments of the hits of the same wall within `width_m` about each hit: shape (6, N).

    Rows: w, wx, wy, wxx, wxy, wyy.
    """
    n, limit = x.size, width_m * width_m
    out = np.empty((6, n))
    for i in range(n):
        w0, wx, wy, wxx, wxy, wyy = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for side in (-1, 1):
            j, edge = i, 0 if side < 0 else n - 1
            for step in range(1, _MOST_NEIGHBOURS):
                if j == edge or not joined[min(j, j + side)]:
                    break
                j += side
                dx, dy = x[j] - x[i], y[j] - y[i]
                d2 = dx * dx + dy * dy
                if d2 >= limit and step > 1:
                    break
                near = max(1.0 - d2 / limit, 0.0)
                w = near * near
                w = max(w, _FIRST_WEIGHT) if step == 1 else w
                w0 += w
                wx += w * dx
                wy += w * dy
                wxx += w * dx * dx
                wxy += w * dx * dy
                wyy += w * dy * dy
        out[0, i], out[1, i], out[2, i], out[3, i], out[4, i], out[5, i] = w0, wx, wy, wxx, wxy, wyy
    return out


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _fit_lines(x, y, r, moments, level):  # type: ignore[no-untyped-def]
    """Fit the wall around each beam by u = a + b t in the beam's own axes (u along the beam, t across it).

    Differences of neighbouring beams would do it too, but 12 mm of noise over their 17 mm make gradients that are mostly
    noise, and small motions read wrongly.
    """
    for i in range(x.size):
        c, s, w0 = x[i] / r[i], y[i] / r[i], moments[0, i]
        mx, my = moments[1, i] / w0, moments[2, i] / w0
        sxx, sxy, syy = moments[3, i] / w0 - mx * mx, moments[4, i] / w0 - mx * my, moments[5, i] / w0 - my * my
        suu = c * c * sxx + 2.0 * c * s * sxy + s * s * syy
        stt = s * s * sxx - 2.0 * c * s * sxy + c * c * syy
        stu = c * s * (syy - sxx) + (c * c - s * s) * sxy
        lined = stt >= _LEAST_SPREAD_M2
        b = stu / stt if lined else 0.0
        smooth = c * mx + s * my - b * (c * my - s * mx) if lined else 0.0
        level[i, X], level[i, Y] = x[i] + smooth * c, y[i] + smooth * s
        level[i, SLOPE] = b if b != 0.0 or not lined else 1e-12
        level[i, GAIN] = 1.0 / (w0 * stt) if lined else 0.0
        level[i, BEND] = max(suu - b * b * stt, 0.0)
