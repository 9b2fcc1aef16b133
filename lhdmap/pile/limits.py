"""The walls at the face: what bounds its width, and how well that is known."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.face import Face
from lhdmap.pile.order import cell_numbers, grouped, quantile, select, spread_about

_WALL_CELL_M = 0.1
_MOUTH_M = 1.2
_WIDER_M = 0.22  # a wall at the face so much farther out is a stope's: the drift's mouth counts
_WALL_SLACK_M = 0.45  # a wall at the face stands no farther from the line of the wall before


class Limits(NamedTuple):
    """Left and right wall at the face, y in the end frame (m), with standard deviations.

    `opens`: no wall reaches the face on some side; `gap_m`: length before the face on which the worse side's wall was not seen.
    """

    left_m: float
    right_m: float
    left_std_m: float
    right_std_m: float
    opens: bool
    gap_m: float


def limits_of(points: FloatArray, face: Face, floor_m: float, half_m: float) -> Limits:
    """Return the walls in the last metre before the face, from hits (N, 4) in the end frame; where the drift opens, its mouth."""
    return Limits(*_limits(points, (face.a, face.b, face.c), floor_m, half_m))


@nb.njit(cache=True, nogil=True)
def _limits(points, face, floor, half):  # type: ignore[no-untyped-def]
    """Return the fields of `Limits`."""
    a, b, c = face
    # rubble of a shallow face reaches far along the drift: off it by a distance along the normal
    off = max(0.15, 0.2 * math.sqrt(1.0 + c**2))
    before = points[:, 0] - (a + b * points[:, 1] + c * points[:, 2])
    height = points[:, 2] - floor
    standing = (height > 0.3) & (height < 1.5) & (before < -off) & (before > -8.0)
    hits, before_wall = points[standing], before[standing]
    at_face = hits[before_wall > -0.75 - off]
    left, left_std = _wall(at_face, 1.0, half)
    right, right_std = _wall(at_face, -1.0, half)
    # what is not there is not nearer either
    opens = not (left <= half + _WIDER_M and right <= half + _WIDER_M)
    if opens:
        drift = hits[before_wall < -0.15 - off]
        left, left_std = _mouth(drift, 1.0, half)
        right, right_std = _mouth(drift, -1.0, half)
    if math.isnan(left):
        left, left_std = half, 0.5
    if math.isnan(right):
        right, right_std = half, 0.5
    gap = max(_gap(points, before, 1.0, half), _gap(points, before, -1.0, half))
    return left, -right, left_std, right_std, opens, gap


@nb.njit(cache=True, nogil=True)
def _gap(points, before, side, half):  # type: ignore[no-untyped-def]
    """Return the distance from the last hits of a wall to the face."""
    wall, count = np.empty(before.size), 0
    for i in range(before.size):
        y = side * points[i, 1]
        if y > half - 0.7 and y < half + 0.6 and before[i] < -0.1:
            wall[count] = before[i]
            count += 1
    return -select(wall, count, count - 8) if count >= 8 else 99.0


@nb.njit(cache=True, nogil=True)
def _wall(points, side, half):  # type: ignore[no-untyped-def]
    """Return the distance of a wall from the middle and its standard deviation; NaN where none is near."""
    y = _cell_medians(points[side * points[:, 1] > 0.5], side)
    y = y[np.abs(y - half) < _WALL_SLACK_M]
    if y.size < 5:
        return math.nan, math.nan
    middle = quantile(y, y.size, 0.5)
    return middle, _deviation(y, middle)


@nb.njit(cache=True, nogil=True)
def _cell_medians(points, side):  # type: ignore[no-untyped-def]
    """Return how far to a side the wall is in each (x, z) cell: near patches have many hits and must not outvote."""
    numbers, count = cell_numbers(points[:, 0].copy(), points[:, 2].copy(), _WALL_CELL_M)
    y, starts = grouped(side * points[:, 1], numbers, count)
    out, used = np.empty(count), 0
    for k in range(count):
        hits = starts[k + 1] - starts[k]
        if hits:
            out[used] = select(y[starts[k] : starts[k + 1]], hits, hits // 2)
            used += 1
    return out[:used]


@nb.njit(cache=True, nogil=True)
def _mouth(points, side, half):  # type: ignore[no-untyped-def]
    """Return how far to a side one can look past the drift's last metre of wall: what stands out most at each height."""
    wall = points[np.abs(side * points[:, 1] - half) < _WALL_SLACK_M]
    if wall.shape[0] < 16:
        return math.nan, math.nan
    x = wall[:, 0].copy()
    wall = wall[wall[:, 0] > select(x, x.size, x.size - 8) - _MOUTH_M]
    rows, count = cell_numbers(wall[:, 2].copy(), np.zeros(wall.shape[0]), _WALL_CELL_M)
    y, starts = grouped(side * wall[:, 1], rows, count)
    inner, used = np.empty(count), 0
    for k in range(count):
        hits = starts[k + 1] - starts[k]
        if hits:
            inner[used] = quantile(y[starts[k] : starts[k + 1]], hits, 0.05)
            used += 1
    middle = quantile(inner, used, 0.5)
    return middle, _deviation(inner[:used], middle) + 0.05


@nb.njit(cache=True, nogil=True)
def _deviation(y, middle):  # type: ignore[no-untyped-def]
    """Return the standard deviation of the middle of rough rock: few independent bumps in a metre."""
    return max(spread_about(y, y.size, middle) / math.sqrt(4.0), 0.03)
