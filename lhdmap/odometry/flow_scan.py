"""A scan prepared for range flow: local least squares ranges and gradients, and which neighbours share a wall."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

JUMP_SLOPE = 14.0  # neighbours whose line to each other is steeper than this against the beam do not share a wall
_MOST_NEIGHBOURS = 24
_FEWEST_BEAMS = 20


class FlowScan(NamedTuple):
    """One level of a scan, seen from the scanner in its level frame; arrays of shape (N,), beams in rising angle.

    `cos`, `sin`: direction; `range_m`: local least squares range; `slope`: dR/dtheta / R of the wall there
    (0: no wall line); `slope_gain`: variance of that slope for
    a range noise of 1 m; `bend_m`: scatter of the hits about that line; `joined`: 1 where beams i and i + 1 see the same wall.
    """

    cos: FloatArray
    sin: FloatArray
    range_m: FloatArray
    slope: FloatArray
    slope_gain: FloatArray
    bend_m: FloatArray
    joined: FloatArray


class Pyramid:
    """A scan's levels, made when they are asked for; level k keeps every 2^k-th beam and fits lines 2^k times as wide.

    `points_m`: hits, shape (N, 2) or more columns, about the scanner. They are put in the order of their angle; any order,
    offset and spacing of the beams will do. Most comparisons are near enough to need the finest level alone.
    """

    def __init__(self, points_m: FloatArray, width_m: float, levels: int) -> None:
        angle = np.arctan2(points_m[:, 1], points_m[:, 0])
        if (angle[1:] < angle[:-1]).any():
            order = np.argsort(angle, kind="stable")
            points_m, angle = points_m[order], angle[order]
        self._points, self._angle, self._width_m = points_m, angle, width_m
        self._levels: dict[int, FlowScan] = {}
        self.coarsest = 0
        while self.coarsest < levels - 1 and len(angle) >> (self.coarsest + 1) >= _FEWEST_BEAMS:
            self.coarsest += 1

    def level(self, level: int) -> FlowScan:
        """Return one level, 0 the finest."""
        if level not in self._levels:
            stride = 1 << level
            fields = _prepare(self._angle[::stride].copy(), self._points[::stride].copy(), self._width_m * stride)
            self._levels[level] = FlowScan(*fields)
        return self._levels[level]


@nb.njit(cache=True, nogil=True)
def _spacing(angle):  # type: ignore[no-untyped-def]
    """Return the usual angle between neighbours: the mean of the gaps that no missing beam has widened."""
    n = angle.size
    if n < 2:
        return 1.0
    mean = (angle[n - 1] - angle[0]) / (n - 1)
    total, count = 0.0, 0
    for _ in range(2):
        total, count = 0.0, 0
        for i in range(n - 1):
            gap = angle[i + 1] - angle[i]
            if gap <= 1.5 * mean:
                total += gap
                count += 1
        mean = total / count if count else mean
    return mean


@nb.njit(cache=True, nogil=True)
def _prepare(angle, points, width_m):  # type: ignore[no-untyped-def]
    """Return the fields of a FlowScan."""
    n = angle.size
    cos, sin, raw = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        raw[i] = max(math.sqrt(points[i, 0] ** 2 + points[i, 1] ** 2), 1e-6)
        cos[i], sin[i] = points[i, 0] / raw[i], points[i, 1] / raw[i]
    spacing = _spacing(angle)
    joined = np.zeros(n)
    for i in range(n - 1):
        gap = angle[i + 1] - angle[i]
        nearer = min(raw[i], raw[i + 1])
        joined[i] = gap < 2.6 * spacing and abs(raw[i + 1] - raw[i]) < JUMP_SLOPE * nearer * gap + 0.05
    smooth, slope, gain, bend = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        _local_line(i, raw, cos, sin, joined, width_m, smooth, slope, gain, bend)
    return cos, sin, smooth, slope, gain, bend, joined


@nb.njit(cache=True, nogil=True)
def _local_line(i, raw, cos, sin, joined, width_m, smooth, slope, gain, bend):  # type: ignore[no-untyped-def]
    """Fit the wall around beam i by u = a + b t in the beam's own axes (u along the beam, t across it), within `width_m`.

    Differences of neighbouring beams would do it too, but 12 mm of noise over their 17 mm make gradients that are mostly
    noise, and small motions read wrongly.
    """
    n = raw.size
    w0, wt, wu, wtt, wtu, wuu = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for side in (-1, 1):
        j = i
        for step in range(1, _MOST_NEIGHBOURS):
            if (side < 0 and (j == 0 or joined[j - 1] == 0.0)) or (side > 0 and (j == n - 1 or joined[j] == 0.0)):
                break
            j += side
            px, py = raw[j] * cos[j], raw[j] * sin[j]
            u = px * cos[i] + py * sin[i] - raw[i]
            t = -px * sin[i] + py * cos[i]
            d2 = (u * u + t * t) / (width_m * width_m)
            if d2 >= 1.0 and step > 1:
                break
            w = (1.0 - d2) * (1.0 - d2) if d2 < 1.0 else 0.0
            w = max(w, 0.2) if step == 1 else w  # sparse walls: the two neighbours still give the slope
            w0 += w
            wt += w * t
            wu += w * u
            wtt += w * t * t
            wtu += w * t * u
            wuu += w * u * u
    mt, mu = wt / w0, wu / w0
    stt = wtt / w0 - mt * mt
    smooth[i] = raw[i]
    if stt < 1e-10:
        return
    b = (wtu / w0 - mt * mu) / stt
    smooth[i] = raw[i] + mu - b * mt
    slope[i] = b if b != 0.0 else 1e-12
    gain[i] = 1.0 / (w0 * stt)
    bend[i] = math.sqrt(max(wuu / w0 - mu * mu - b * b * stt, 0.0))
