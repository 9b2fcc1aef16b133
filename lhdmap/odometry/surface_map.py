"""The local map that scans are matched against: hits averaged in cells of three sizes, walls as moving-least-squares lines.

Each level is a grid that wraps around (its cell's key tells which place of the world it holds), so memory is fixed and the
oldest places are replaced as the machine drives on. Coarse levels serve sparse, distant walls and starts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray, Float32Array

KERNEL_CELLS = 3  # a line is fitted to the cells within this many cells of a point
KERNEL_SIGMA_CELLS = 2.0


class Level(NamedTuple):
    """One grid: `keys` (n * n,) int64, `hits` (n * n, 3) float32 as count and mean offset x, y from the cell's corner, metres."""

    cell_m: float
    keys: npt.NDArray[np.int64]
    hits: Float32Array


class SurfaceMap(NamedTuple):
    """Grids from fine to coarse that hold the same hits."""

    fine: Level
    middle: Level
    coarse: Level


def empty_map(cell_m: float, cells: int = 2048) -> SurfaceMap:
    """Return an empty map with cells of `cell_m`, 3 x and 9 x that; the fine window is `cells * cell_m` wide."""
    return SurfaceMap(_level(cell_m, cells), _level(3 * cell_m, cells // 2), _level(9 * cell_m, cells // 4))


def _level(cell_m: float, cells: int) -> Level:
    # zeros are mapped lazily by the operating system: only pages that walls touch take memory; a key of 0 marks an empty cell
    return Level(cell_m, np.zeros(cells * cells, dtype=np.int64), np.zeros((cells * cells, 3), dtype=np.float32))


@nb.njit(cache=True, nogil=True, inline="always")
def _key(ix: int, iy: int) -> int:
    """Return a key, never 0, that tells the cell (ix, iy) from all others."""
    return (ix + (1 << 30)) * (1 << 31) + (iy + (1 << 30)) + 1


@nb.njit(cache=True, nogil=True)
def insert(level: Level, points_m: FloatArray, count_limit: float) -> None:
    """Average points, shape (N, 2), map frame, into their cells; beyond `count_limit` hits the mean forgets the oldest."""
    size = int(math.sqrt(level.keys.size))
    mask = size - 1
    inverse = 1.0 / level.cell_m
    for i in range(points_m.shape[0]):
        fx, fy = points_m[i, 0] * inverse, points_m[i, 1] * inverse
        if not (abs(fx) < 1e8 and abs(fy) < 1e8):
            continue
        ix, iy = int(math.floor(fx)), int(math.floor(fy))
        slot = (ix & mask) * size + (iy & mask)
        key = _key(ix, iy)
        if level.keys[slot] != key:
            level.keys[slot] = key
            level.hits[slot, 0] = 0.0
            level.hits[slot, 1] = 0.0
            level.hits[slot, 2] = 0.0
        n = min(level.hits[slot, 0] + 1.0, count_limit)
        level.hits[slot, 0] = n
        level.hits[slot, 1] += (points_m[i, 0] - ix * level.cell_m - level.hits[slot, 1]) / n
        level.hits[slot, 2] += (points_m[i, 1] - iy * level.cell_m - level.hits[slot, 2]) / n


@nb.njit(cache=True, nogil=True)
def fit_line(level: Level, x: float, y: float, min_cells: float, line: FloatArray) -> bool:
    """Fit the wall near (x, y) by a line with Gaussian weights; return whether the cells there support one.

    `line`, shape (6,), receives: centre x, y, normal x, y, scatter across the line (variance, m²), effective number of cells.
    """
    size = int(math.sqrt(level.keys.size))
    mask = size - 1
    cell = level.cell_m
    cx, cy = int(math.floor(x / cell)), int(math.floor(y / cell))
    scale = -0.5 / (KERNEL_SIGMA_CELLS * cell) ** 2
    reach = (KERNEL_CELLS * cell) ** 2
    s0 = s1 = sx = sy = sxx = sxy = syy = 0.0
    for ix in range(cx - KERNEL_CELLS, cx + KERNEL_CELLS + 1):
        row = (ix & mask) * size
        for iy in range(cy - KERNEL_CELLS, cy + KERNEL_CELLS + 1):
            slot = row + (iy & mask)
            if level.keys[slot] != _key(ix, iy):
                continue
            dx = ix * cell + level.hits[slot, 1] - x
            dy = iy * cell + level.hits[slot, 2] - y
            d2 = dx * dx + dy * dy
            if d2 > reach:
                continue
            n = level.hits[slot, 0]
            w = math.exp(scale * d2) * n / (n + 1.0)
            s0 += w
            s1 += w * w
            sx += w * dx
            sy += w * dy
            sxx += w * dx * dx
            sxy += w * dx * dy
            syy += w * dy * dy
    if s0 <= 0.0:
        return False
    effective = s0 * s0 / s1
    mx, my = sx / s0, sy / s0
    cxx, cxy, cyy = sxx / s0 - mx * mx, sxy / s0 - mx * my, syy / s0 - my * my
    half_trace, half_difference = 0.5 * (cxx + cyy), 0.5 * (cxx - cyy)
    root = math.sqrt(half_difference * half_difference + cxy * cxy)
    small, large = max(half_trace - root, 0.0), half_trace + root
    # A line wants cells spread along it over about a kernel's width, and little beside it. Chords between a few sparse hits
    # fit best where those beams hit before: they pull the estimate towards standing still.
    if effective < min_cells or large < (0.7 * cell) ** 2 or small > 0.3 * large:
        return False
    angle = 0.5 * math.atan2(2.0 * cxy, cxx - cyy)
    line[0] = x + mx
    line[1] = y + my
    line[2] = -math.sin(angle)
    line[3] = math.cos(angle)
    line[4] = small
    line[5] = effective
    return True


@nb.njit(cache=True, nogil=True)
def insert_all(map_: SurfaceMap, points_m: FloatArray, count_limit: float) -> None:
    """Insert points, shape (N, 2), map frame, into all levels."""
    insert(map_.fine, points_m, count_limit)
    insert(map_.middle, points_m, count_limit)
    insert(map_.coarse, points_m, count_limit)
