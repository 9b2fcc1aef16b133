"""Boxes against a grid of triangles: the deepest contact of each, the least distance of all."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.vehicle.box_triangle import depth_in, triangle_distance, workspace
from lhdmap.simulation.vehicle.contact_grid import CELL_M, Grid


@nb.njit(cache=True, nogil=True)
def near_pieces(
    bounds_m: FloatArray, centre: FloatArray, axes: FloatArray, half: FloatArray, reach_m: float
) -> list[int]:
    """Return which pieces, given by `bounds_m` (P, 2, 3), are within `reach_m` of a box (by their upright bounds)."""
    near = [0 for _ in range(0)]
    for p in range(len(bounds_m)):
        for b in range(len(centre)):
            apart = False
            for k in range(3):
                size = reach_m + _extent(axes[b], half[b], k)
                apart = apart or centre[b, k] - size > bounds_m[p, 1, k] or centre[b, k] + size < bounds_m[p, 0, k]
            if not apart:
                near.append(p)
                break
    return near


@nb.njit(cache=True, nogil=True)
def _first_cell(column: npt.NDArray[np.int32], low: int, high: int, wanted: int) -> int:
    """Return the first cell of a row, in `low` to `high`, whose column is not below `wanted`."""
    while low < high:
        middle = (low + high) // 2
        if column[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@nb.njit(cache=True, nogil=True)
def _cells_near(
    grid: Grid,
    centre: FloatArray,
    axes: FloatArray,
    half: FloatArray,
    reach_m: float,
    found: npt.NDArray[np.int32],
    lower: FloatArray,
) -> int:
    """Write the cells whose triangles may be within `reach_m` of a box into `found`, and how near they can be into `lower`.

    Returns how many these are; the nearest is the first of them.
    """
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        size = reach_m + grid.radius_m + _extent(axes, half, k)
        low[k], high[k] = math.floor((centre[k] - size) / CELL_M), math.floor((centre[k] + size) / CELL_M)
    count = 0
    for row in range(max(low[0], 0), min(high[0] + 1, len(grid.row_first) - 1)):
        end = grid.row_first[row + 1]
        for cell in range(_first_cell(grid.column, grid.row_first[row], end, low[1]), end):
            if grid.column[cell] > high[1]:
                break
            if low[2] <= grid.height[cell] <= high[2]:
                least = _disc_gap(grid.discs, cell, centre, axes, half)
                if least <= reach_m:
                    found[count], lower[count] = cell, least
                    if least < lower[0]:
                        found[0], found[count] = found[count], found[0]
                        lower[0], lower[count] = lower[count], lower[0]
                    count += 1
    return count


@nb.njit(cache=True, nogil=True)
def _extent(axes: FloatArray, half: FloatArray, k: int) -> float:
    """Return how far a box reaches from its middle along axis `k` of `map`."""
    return abs(axes[k, 0]) * half[0] + abs(axes[k, 1]) * half[1] + abs(axes[k, 2]) * half[2]


@nb.njit(cache=True, nogil=True)
def _disc_gap(discs: FloatArray, cell: int, centre: FloatArray, axes: FloatArray, half: FloatArray) -> float:
    """Return how near what a cell has can be to a box: by the shadows of its disc on the axes of the box."""
    x, y, z = discs[cell, 0] - centre[0], discs[cell, 1] - centre[1], discs[cell, 2] - centre[2]
    nx, ny, nz, thick, radius = discs[cell, 3], discs[cell, 4], discs[cell, 5], discs[cell, 6], discs[cell, 7]
    total = 0.0
    for k in range(3):
        upright = abs(axes[0, k] * nx + axes[1, k] * ny + axes[2, k] * nz)
        shadow = upright * thick + math.sqrt(max(1.0 - upright * upright, 0.0)) * radius
        gap = max(abs(axes[0, k] * x + axes[1, k] * y + axes[2, k] * z) - half[k] - shadow, 0.0)
        total += gap * gap
    return math.sqrt(total)


@nb.njit(cache=True, nogil=True)
def _into_box(triangles: Float32Array, t: int, centre: FloatArray, axes: FloatArray, out: FloatArray) -> None:
    """Write triangle `t` of (N, 3, 3) in the frame of the box into `out` (3, 3)."""
    for i in range(3):
        x, y, z = triangles[t, i, 0] - centre[0], triangles[t, i, 1] - centre[1], triangles[t, i, 2] - centre[2]
        for k in range(3):
            out[i, k] = axes[0, k] * x + axes[1, k] * y + axes[2, k] * z


@nb.njit(cache=True, nogil=True)
def _gap(x: float, y: float, z: float, axes: FloatArray, half: FloatArray) -> float:
    """Return the distance of a point, seen from the middle of the box, from the box; below zero inside."""
    a = abs(axes[0, 0] * x + axes[1, 0] * y + axes[2, 0] * z) - half[0]
    b = abs(axes[0, 1] * x + axes[1, 1] * y + axes[2, 1] * z) - half[1]
    c = abs(axes[0, 2] * x + axes[1, 2] * y + axes[2, 2] * z) - half[2]
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    return math.sqrt(a * a + b * b + c * c)


@nb.njit(cache=True, nogil=True)
def _least_gap(corners: FloatArray, half: FloatArray) -> float:
    """Return how near a triangle (3, 3) can be to the box, by its bounds in the frame of the box."""
    total = 0.0
    for k in range(3):
        low = min(corners[0, k], corners[1, k], corners[2, k]) - half[k]
        high = -max(corners[0, k], corners[1, k], corners[2, k]) - half[k]
        gap = max(low, high, 0.0)
        total += gap * gap
    return math.sqrt(total)


@nb.njit(cache=True, nogil=True)
def deepest(grid: Grid, centres: FloatArray, axes: FloatArray, half: FloatArray, found: FloatArray) -> None:
    """Write the deepest contact of each box, point in `map` and depth, into `found` (K, 4) where it is deeper."""
    cells, lower = np.empty(len(grid.column), np.int32), np.empty(len(grid.column))
    work, corners, point = workspace(), np.empty((3, 3)), np.empty(3)
    spheres = grid.spheres
    for b in range(len(centres)):
        centre, turned, size = centres[b] - grid.origin_m, axes[b], half[b]
        for c in range(_cells_near(grid, centre, turned, size, 0.0, cells, lower)):
            for t in range(grid.first[cells[c]], grid.first[cells[c] + 1]):
                x, y, z = spheres[t, 0] - centre[0], spheres[t, 1] - centre[1], spheres[t, 2] - centre[2]
                if _gap(x, y, z, turned, size) > spheres[t, 3]:
                    continue
                _into_box(grid.corners, t, centre, turned, corners)
                if _least_gap(corners, size) > 0.0:
                    continue
                depth = depth_in(corners, size, found[b, 3], work, point)
                if depth > found[b, 3]:
                    found[b, 3] = depth
                    for k in range(3):
                        found[b, k] = centres[b, k] + (
                            turned[k, 0] * point[0] + turned[k, 1] * point[1] + turned[k, 2] * point[2]
                        )


@nb.njit(cache=True, nogil=True)
def clearance(grid: Grid, centres: FloatArray, axes: FloatArray, half: FloatArray, best: float) -> float:
    """Return the least distance of the boxes from the triangles where it is less than `best`, m, else `best`."""
    cells, lower = np.empty(len(grid.column), np.int32), np.empty(len(grid.column))
    work, corners = workspace(), np.empty((3, 3))
    spheres = grid.spheres
    for b in range(len(centres)):
        centre, turned, size = centres[b] - grid.origin_m, axes[b], half[b]
        for c in range(_cells_near(grid, centre, turned, size, best, cells, lower)):
            if lower[c] >= best:
                continue
            for t in range(grid.first[cells[c]], grid.first[cells[c] + 1]):
                x, y, z = spheres[t, 0] - centre[0], spheres[t, 1] - centre[1], spheres[t, 2] - centre[2]
                if _gap(x, y, z, turned, size) - spheres[t, 3] >= best:
                    continue
                _into_box(grid.corners, t, centre, turned, corners)
                if _least_gap(corners, size) < best:
                    best = triangle_distance(corners, size, best, work)
            if best <= 0.0:
                return 0.0
    return best
