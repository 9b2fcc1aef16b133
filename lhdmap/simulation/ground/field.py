"""A pile as a field of heights: its grid in the plan, sliding on all sides, and turning the grid to a machine's heading."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

ALONG_M, ACROSS_M = 0.05, 0.1
"""Size of the cells, along and across the heading of the grid."""
CELL_M2 = ALONG_M * ACROSS_M
Bools = npt.NDArray[np.bool_]


class Grid(NamedTuple):
    """Where the cells are: the middle of cell (0, 0) in `map` (x, y), heading of the first index, numbers of cells."""

    x_m: float
    y_m: float
    heading_rad: float
    shape: tuple[int, int]

    def points(self) -> FloatArray:
        """Return the middles of the cells in `map`, shape (N, M, 2)."""
        along = ALONG_M * np.arange(self.shape[0])[:, None]
        across = ACROSS_M * np.arange(self.shape[1])[None, :]
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return np.stack([self.x_m + c * along - s * across, self.y_m + s * along + c * across], axis=2)

    def places(self, points_m: FloatArray) -> FloatArray:
        """Return the places of points (..., 2) of `map` in cells, along and across, shape (..., 2)."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        away = points_m - np.array([self.x_m, self.y_m])
        along, across = away @ np.array([c, s]), away @ np.array([-s, c])
        return np.stack([along / ALONG_M, across / ACROSS_M], axis=-1)


def turned(grid: Grid, through_m: FloatArray, heading_rad: float) -> Grid:
    """Return a grid around all cells of `grid`, along a heading, with the border of two columns through a point (2,)."""
    corners = np.array([[i, j] for i in (0, grid.shape[0] - 1) for j in (0, grid.shape[1] - 1)], dtype=float)
    c0, s0 = math.cos(grid.heading_rad), math.sin(grid.heading_rad)
    away = corners * np.array([ALONG_M, ACROSS_M]) @ np.array([[c0, s0], [-s0, c0]])
    away += np.array([grid.x_m, grid.y_m]) - through_m
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    along, across = away @ np.array([c, s]), away @ np.array([-s, c])
    first = math.floor(float(along.min()) / ALONG_M), math.floor(float(across.min()) / ACROSS_M) - 0.5
    count = math.ceil(float(np.ptp(along)) / ALONG_M) + 2, math.ceil(float(np.ptp(across)) / ACROSS_M) + 3
    x = through_m[0] + c * first[0] * ALONG_M - s * first[1] * ACROSS_M
    y = through_m[1] + s * first[0] * ALONG_M + c * first[1] * ACROSS_M
    return Grid(float(x), float(y), heading_rad, count)


@nb.njit(cache=True, nogil=True)
def slide_field(
    heights: FloatArray, open_cells: Bools, slope: float, share: float, bucket: tuple[int, int, int, int], *, down: bool
) -> float:
    """Let what is steeper than `slope` (a tangent) slide by a share of its excess; returns the largest excess, m.

    `heights` (N, M) are changed, their sum is not. Closed cells are rock. `bucket`: first and last column of the bucket, the row
    of its lip and of its heel; (0, -1, 0, 0) for none. Between its columns the side view moves the rock, and none falls on it.
    `down`: whether rows are gone through from the last to the first; by turns, ore runs far in few sweeps.
    """
    rows, columns = heights.shape
    worst = 0.0
    first, last, lip, heel = bucket
    for n in range(rows):
        i = rows - 1 - n if down else n
        for j in range(columns):
            if not open_cells[i, j]:
                continue
            mine = first <= j <= last
            for way in range(2):
                k, m = (i + 1, j) if way == 0 else (i, j + 1)
                if k >= rows or m >= columns or not open_cells[k, m]:
                    continue
                other = first <= m <= last
                if (mine and other) or ((mine or other) and heel <= i <= lip):
                    continue
                drop = heights[k, m] - heights[i, j]
                excess = abs(drop) - slope * (ALONG_M if way == 0 else ACROSS_M)
                if excess > 0.0:
                    moved = math.copysign(0.5 * share * excess, drop)
                    heights[k, m] -= moved
                    heights[i, j] += moved
                    worst = max(worst, excess)
    return worst


@nb.njit(cache=True, nogil=True)
def spread_back(heights: FloatArray, open_cells: Bools, first: int, last: int, change: FloatArray) -> None:
    """Give the changes (N,) of the side view's mean heights back to the columns: taken by share of height, put evenly.

    The mean is over all columns, those in rock too (they have no ore): so volumes agree.
    """
    for i in range(len(change)):
        if change[i] == 0.0:
            continue
        mean, room = 0.0, 0
        for j in range(first, last + 1):
            mean += heights[i, j] / (last - first + 1)
            room += open_cells[i, j]
        for j in range(first, last + 1):
            if change[i] <= 0.0 and mean > 1e-9:
                heights[i, j] *= max(1.0 + change[i] / mean, 0.0)
            elif room == 0 or open_cells[i, j]:
                heights[i, j] += change[i] * (last - first + 1) / (room if room > 0 else last - first + 1)
