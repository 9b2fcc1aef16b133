"""The field: for each cell around the predicted way the nearest hit; distances are to that hit, not to a cell.

Nearest hits are found in each row first, across the rows by the lower envelope of parabolas (Felzenszwalb, Huttenlocher 2012).

Of the hits in a cell the one nearest to the predicted way stays, so that thinning makes no room. Whether a point of an outline
is beyond a wall is told from within: from the body's axis one walks outward by as much as is known to be free (sphere tracing);
a hit that is passed before the outline is one of a wall that the outline has crossed. The sign needs neither normals nor a flood,
which leaks through the gaps between hits far ahead.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

CELL_M = 0.10
FAR_M = 3.0
_TOUCH_M = 0.12  # thinned hits of a wall are up to two cells apart: no look slips between them
_PAST_M = 0.02
_MARGIN_M = 5.5
_MOST_CELLS = 400_000


class Field(NamedTuple):
    """`origin` (2,): corner of the first cell; `nearest` (H, W): index of the nearest of `hits` (N, 2), -1 where none is near."""

    origin: FloatArray
    nearest: npt.NDArray[np.int32]
    hits: FloatArray


def field_around(hits: FloatArray, way: FloatArray) -> Field:
    """Return the field of hits (N, 2) around a predicted way (K, 2) of the leading axle."""
    low, high = way.min(axis=0) - _MARGIN_M, way.max(axis=0) + _MARGIN_M
    shape = np.ceil((high - low) / CELL_M).astype(np.int64) + 1
    if shape.prod() > _MOST_CELLS:  # a way that long is none that will be driven
        high = low + CELL_M * math.sqrt(_MOST_CELLS)
        shape = np.minimum(shape, int(math.sqrt(_MOST_CELLS)))
    inside = _inside(hits, low, high)
    nearest = _nearest(inside, way[:: max(len(way) // 12, 1)], low, int(shape[0]), int(shape[1]))
    return Field(low, nearest, inside)


@nb.njit(cache=True, nogil=True)
def _inside(hits: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    kept, count = np.empty((len(hits), 2)), 0
    for n in range(len(hits)):
        x, y = hits[n, 0], hits[n, 1]
        if low[0] <= x < high[0] and low[1] <= y < high[1]:
            kept[count, 0], kept[count, 1] = x, y
            count += 1
    return kept[:count]


@nb.njit(cache=True, nogil=True)
def _nearest(hits: FloatArray, way: FloatArray, low: FloatArray, rows: int, columns: int) -> npt.NDArray[np.int32]:
    """Return the index of the nearest hit of each cell: the nearest one of each row first, of those the nearest across rows."""
    in_row = np.full((rows, columns), -1, np.int32)
    _seed(in_row, hits, way, low)
    for i in range(rows):
        _spread(in_row[i], hits, low[1])
    found = np.full((rows, columns), -1, np.int32)
    chosen, until = np.empty(rows, np.int32), np.empty(rows)
    for j in range(columns):
        count = _envelope(in_row[:, j], hits, low[1] + (j + 0.5) * CELL_M, chosen, until)
        k = 0
        for i in range(rows):
            x = low[0] + (i + 0.5) * CELL_M
            while k + 1 < count and until[k] < x:
                k += 1
            if k < count:
                dx, dy = hits[chosen[k], 0] - x, hits[chosen[k], 1] - low[1] - (j + 0.5) * CELL_M
                if dx * dx + dy * dy < FAR_M * FAR_M:
                    found[i, j] = chosen[k]
    return found


@nb.njit(cache=True, nogil=True)
def _seed(found: npt.NDArray[np.int32], hits: FloatArray, way: FloatArray, low: FloatArray) -> None:
    """Put the hit of each cell that is nearest to the way into it: to the point of the way that is nearest to the cell."""
    aside, beside = np.empty(found.shape), np.empty(found.shape, np.int32)
    for n in range(len(hits)):
        x, y = hits[n, 0], hits[n, 1]
        i, j = int((x - low[0]) / CELL_M), int((y - low[1]) / CELL_M)
        if found[i, j] < 0:
            beside[i, j] = _beside(way, x, y)
            aside[i, j] = math.inf
        k = beside[i, j]
        square = (x - way[k, 0]) ** 2 + (y - way[k, 1]) ** 2
        if square < aside[i, j]:
            found[i, j], aside[i, j] = n, square


@nb.njit(cache=True, nogil=True)
def _beside(way: FloatArray, x: float, y: float) -> int:
    best, which = math.inf, 0
    for k in range(len(way)):
        square = (x - way[k, 0]) ** 2 + (y - way[k, 1]) ** 2
        if square < best:
            best, which = square, k
    return which


@nb.njit(cache=True, nogil=True)
def _spread(row: npt.NDArray[np.int32], hits: FloatArray, low_y: float) -> None:
    """Give each cell of a row the hit that is nearest along the row."""
    left = -1
    for j in range(len(row)):
        if row[j] >= 0:
            left = row[j]
        row[j] = left
    right = -1
    for j in range(len(row) - 1, -1, -1):
        y = low_y + (j + 0.5) * CELL_M
        here = row[j]
        if here >= 0 and abs(hits[here, 1] - y) <= 0.5 * CELL_M + 1e-9:
            right = here
        if here < 0 or (right >= 0 and abs(hits[right, 1] - y) < abs(hits[here, 1] - y)):
            row[j] = right


@nb.njit(cache=True, nogil=True)
def _envelope(
    column: npt.NDArray[np.int32], hits: FloatArray, y: float, chosen: npt.NDArray[np.int32], until: FloatArray
) -> int:
    """Return how many hits are the nearest ones somewhere along a column: `chosen`, each `until` an x; the lower envelope."""
    count = 0
    for i in range(len(column)):
        n = column[i]
        if n < 0:
            continue
        x, square = hits[n, 0], (hits[n, 1] - y) ** 2
        if square > FAR_M * FAR_M:
            continue
        while count > 0:
            m = chosen[count - 1]
            apart = x - hits[m, 0]
            if apart > 1e-9:
                middle = 0.5 * (x + hits[m, 0]) + 0.5 * (square - (hits[m, 1] - y) ** 2) / apart
                if count == 1 or middle > until[count - 2]:
                    until[count - 1] = middle
                    break
            elif square >= (hits[m, 1] - y) ** 2:
                break
            count -= 1
        else:
            chosen[0], until[0] = n, math.inf
            count = 1
            continue
        if x - hits[chosen[count - 1], 0] > 1e-9:
            chosen[count], until[count] = n, math.inf
            count += 1
    return count


@nb.njit(cache=True, nogil=True)
def distance(x: float, y: float, field: Field) -> tuple[float, int]:
    """Return the distance of a place from the nearest hit, at most FAR_M, and its index (-1: none)."""
    origin, nearest, hits = field
    u, v = (x - origin[0]) / CELL_M - 0.5, (y - origin[1]) / CELL_M - 0.5
    i0, j0 = int(math.floor(u)), int(math.floor(v))
    best, which = FAR_M * FAR_M, -1
    for i in (i0, i0 + 1):
        for j in (j0, j0 + 1):
            if 0 <= i < nearest.shape[0] and 0 <= j < nearest.shape[1]:
                n = nearest[i, j]
                if n >= 0:
                    dx, dy = hits[n, 0] - x, hits[n, 1] - y
                    square = dx * dx + dy * dy
                    if square < best:
                        best, which = square, n
    return math.sqrt(best), which


@nb.njit(cache=True, nogil=True)
def clearance(px: float, py: float, ax: float, ay: float, field: Field) -> tuple[float, float, float]:
    """Return the signed clearance of an outline's point p with its point a on the axis, and the direction in which it grows."""
    wx, wy = px - ax, py - ay
    length = math.sqrt(wx * wx + wy * wy)
    wx, wy = wx / length, wy / length
    gone, _ = distance(ax, ay, field)
    gone = max(gone - 0.5 * _TOUCH_M, 0.0)
    while gone < length:
        qx, qy = ax + gone * wx, ay + gone * wy
        free, n = distance(qx, qy, field)
        if free >= _TOUCH_M:
            gone += free - 0.5 * _TOUCH_M
            continue
        before = (field.hits[n, 0] - qx) * wx + (field.hits[n, 1] - qy) * wy
        if before <= 0.0:
            return gone + before - length, -wx, -wy
        gone += max(before, _PAST_M) + 1e-3
    d, n = distance(px, py, field)
    if n < 0:
        return FAR_M, 0.0, 0.0
    least = max(d, 1e-3)
    return d, (px - field.hits[n, 0]) / least, (py - field.hits[n, 1]) / least
