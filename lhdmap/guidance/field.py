"""The field: for each cell around the predicted way the nearest hit, by two sweeps; distances are to that hit, not to a cell.

Of the hits in a cell the one nearest to the predicted way stays, so that thinning makes no room. Whether a point of an outline
is beyond a wall is told from within: from the body's axis one walks outward by as much as is known to be free (sphere tracing);
a wall that is met before the outline is a wall that the outline has crossed. The sign needs neither normals nor a flood, which
leaks through the gaps between hits far ahead.
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
_TOUCH_M = 0.05
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
    inside = hits[((hits >= low) & (hits < high)).all(axis=1)]
    nearest = _nearest(inside, way[:: max(len(way) // 12, 1)], low, int(shape[0]), int(shape[1]))
    return Field(low, nearest, inside)


@nb.njit(cache=True, nogil=True)
def _nearest(hits: FloatArray, way: FloatArray, low: FloatArray, rows: int, columns: int) -> npt.NDArray[np.int32]:
    """Return the index of the nearest hit of each cell: seeds, then a sweep down and one up over eight neighbours."""
    found = np.full((rows, columns), -1, np.int32)
    aside = np.empty(len(hits))
    for n in range(len(hits)):
        best = math.inf
        for k in range(len(way)):
            dx, dy = hits[n, 0] - way[k, 0], hits[n, 1] - way[k, 1]
            best = min(best, dx * dx + dy * dy)
        aside[n] = best
        i, j = int((hits[n, 0] - low[0]) / CELL_M), int((hits[n, 1] - low[1]) / CELL_M)
        if found[i, j] < 0 or best < aside[found[i, j]]:
            found[i, j] = n
    for i in range(rows):
        for j in range(columns):
            _nearer(found, hits, low, i, j, -1)
        for j in range(columns - 2, -1, -1):
            _from(found, hits, low, i, j, i, j + 1)
    for i in range(rows - 1, -1, -1):
        for j in range(columns - 1, -1, -1):
            _nearer(found, hits, low, i, j, 1)
        for j in range(1, columns):
            _from(found, hits, low, i, j, i, j - 1)
    return found


@nb.njit(cache=True, nogil=True)
def _nearer(found: npt.NDArray[np.int32], hits: FloatArray, low: FloatArray, i: int, j: int, way: int) -> None:
    _from(found, hits, low, i, j, i, j + way)
    for dj in (-1, 0, 1):
        _from(found, hits, low, i, j, i + way, j + dj)


@nb.njit(cache=True, nogil=True)
def _from(found: npt.NDArray[np.int32], hits: FloatArray, low: FloatArray, i: int, j: int, oi: int, oj: int) -> None:
    """Take a neighbour's hit where it is nearer, and not too far."""
    if oi < 0 or oj < 0 or oi >= found.shape[0] or oj >= found.shape[1] or found[oi, oj] < 0:
        return
    other, own = found[oi, oj], found[i, j]
    if other == own:
        return
    x, y = low[0] + (i + 0.5) * CELL_M, low[1] + (j + 0.5) * CELL_M
    there = (hits[other, 0] - x) ** 2 + (hits[other, 1] - y) ** 2
    if there > FAR_M * FAR_M:
        return
    if own < 0 or there < (hits[own, 0] - x) ** 2 + (hits[own, 1] - y) ** 2:
        found[i, j] = other


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
    while gone < length:
        free, _ = distance(ax + gone * wx, ay + gone * wy, field)
        if free < _TOUCH_M:
            return gone - length, -wx, -wy
        gone += free
    d, n = distance(px, py, field)
    if n < 0:
        return FAR_M, 0.0, 0.0
    least = max(d, 1e-3)
    return d, (px - field.hits[n, 0]) / least, (py - field.hits[n, 1]) / least
