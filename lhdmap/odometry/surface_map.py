"""The local map that scans are matched against: hits averaged in cells of three sizes, walls as moving-least-squares lines.

Each level is a grid that wraps around (a cell's tag tells which place of the world it holds), so memory is fixed and the
oldest places are replaced as the machine drives on. Coarse levels serve sparse, distant walls and starts. A tilted scanner
sees a wall at another height from each distance, and rock is rough in height, too: cells are layered in height, and the line
at a point is the wall's at the height of that point.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray

KERNEL_CELLS = 3  # a line is fitted to the cells within this many cells of a point
LINE = 8  # numbers of a line: see `fit_line`
KERNEL_SIGMA_CELLS = 2.0
LAYERS = 8
LAYER_M = 0.12
_HEIGHT_SIGMA_M = 0.06
_HEIGHT_PER_CELL = 1.5  # ... and at least so many cells: measured, a third less heading drift of a tilted scanner
_FINE_M = 0.05


class Level(NamedTuple):
    """One grid of `size` x `size` columns of cells, kept in tiles of 8 x 8: what a fit reads lies close together in memory.

    `layers` (tiles, 64) uint8: a bit for each layer of a column that ever held hits; `tags` (tiles, LAYERS, 64) int32 (0: empty);
    `hits` (tiles, LAYERS, 64, 4) float32: count and mean offset x, y, z from the cell's corner, metres.
    """

    cell_m: float
    size: int
    layers: npt.NDArray[np.uint8]
    tags: npt.NDArray[np.int32]
    hits: Float32Array


class SurfaceMap(NamedTuple):
    """Grids from fine to coarse that hold the same hits."""

    fine: Level
    middle: Level
    coarse: Level


def empty_map(cell_m: float, cells: int = 1024) -> SurfaceMap:
    """Return an empty map with cells of `cell_m`, 3 x and 9 x that; the fine window is `cells * cell_m` wide."""
    return SurfaceMap(_level(cell_m, cells), _level(3 * cell_m, cells // 2), _level(9 * cell_m, cells // 4))


def _level(cell_m: float, cells: int) -> Level:
    # zeros are mapped lazily by the operating system: only pages that walls touch take memory
    tiles = (cells // 8) ** 2
    return Level(
        cell_m,
        cells,
        np.zeros((tiles, 64), np.uint8),
        np.zeros((tiles, LAYERS, 64), np.int32),
        np.zeros((tiles, LAYERS, 64, 4), np.float32),
    )


@nb.njit(cache=True, nogil=True, inline="always")
def _tag(ix: int, iy: int, iz: int, shift: int) -> int:
    """Return a tag, never 0, that tells the cell (ix, iy, iz) from those that share its place in the window."""
    return (((ix >> shift) & 0x7FF) << 20 | ((iy >> shift) & 0xFFF) << 8 | ((iz >> 3) & 0xFF)) + 1


@nb.njit(cache=True, nogil=True, inline="always")
def _column(ix: int, iy: int, size: int) -> tuple[int, int]:
    """Return tile and place in it of the column (ix, iy) in a window of `size`."""
    jx, jy = ix & (size - 1), iy & (size - 1)
    return (jx >> 3) * (size >> 3) + (jy >> 3), (jx & 7) << 3 | (jy & 7)


@nb.njit(cache=True, nogil=True)
def insert(level: Level, points_m: FloatArray, count_limit: float) -> None:
    """Average points, shape (N, 3), map frame, into their cells; beyond `count_limit` hits the mean forgets the oldest."""
    shift = int(round(math.log2(level.size)))
    inverse = 1.0 / level.cell_m
    for i in range(points_m.shape[0]):
        fx, fy, fz = points_m[i, 0] * inverse, points_m[i, 1] * inverse, points_m[i, 2] / LAYER_M
        if not (abs(fx) < 1e8 and abs(fy) < 1e8 and abs(fz) < 1e6):
            continue
        ix, iy, iz = int(math.floor(fx)), int(math.floor(fy)), int(math.floor(fz))
        tile, place = _column(ix, iy, level.size)
        layer = iz & (LAYERS - 1)
        tag = _tag(ix, iy, iz, shift)
        cell = level.hits[tile, layer, place]
        if level.tags[tile, layer, place] != tag:
            level.tags[tile, layer, place] = tag
            level.layers[tile, place] |= np.uint8(1 << layer)
            cell[:] = 0.0
        n = min(cell[0] + 1.0, count_limit)
        cell[0] = n
        cell[1] += (points_m[i, 0] - ix * level.cell_m - cell[1]) / n
        cell[2] += (points_m[i, 1] - iy * level.cell_m - cell[2]) / n
        cell[3] += (points_m[i, 2] - iz * LAYER_M - cell[3]) / n


@nb.njit(cache=True, nogil=True)
def insert_all(map_: SurfaceMap, points_m: FloatArray, count_limit: float) -> None:
    """Insert points, shape (N, 3), map frame, into all levels."""
    insert(map_.fine, points_m, count_limit)
    insert(map_.middle, points_m, count_limit)
    insert(map_.coarse, points_m, count_limit)


@nb.njit(cache=True, nogil=True, inline="always")
def _neighbours(level: Level, z: float, layered: bool) -> tuple[int, int]:
    """Return the first and the last layer to look at: coarse cells serve distant walls, seen at many heights."""
    own = int(math.floor(z / LAYER_M))
    if not layered:
        return own, own
    if level.cell_m > _FINE_M:
        return own - 1, own + 1
    return (own - 1, own) if z / LAYER_M - own < 0.5 else (own, own + 1)


@nb.njit(cache=True, nogil=True)
def _gather(level: Level, x: float, y: float, z: float, layered: bool, sums: FloatArray) -> bool:
    """Add up the cells around (x, y, z) with Gaussian weights; False where there are none.

    `sums`, shape (8,), receives: weights, squared weights, x, y, z, xx, xy, yy about the point.
    """
    shift, cell = int(round(math.log2(level.size))), level.cell_m
    cx, cy = int(math.floor(x / cell)), int(math.floor(y / cell))
    z_low, z_high = _neighbours(level, z, layered)
    scale, z_scale = -0.5 / (KERNEL_SIGMA_CELLS * cell) ** 2, -0.5 / max(_HEIGHT_SIGMA_M, _HEIGHT_PER_CELL * cell) ** 2
    reach = (KERNEL_CELLS * cell) ** 2
    wanted = 0
    for iz in range(z_low, z_high + 1):
        wanted |= 1 << (iz & (LAYERS - 1))
    s0 = s1 = sx = sy = sz = sxx = sxy = syy = 0.0
    for ix in range(cx - KERNEL_CELLS, cx + KERNEL_CELLS + 1):
        for iy in range(cy - KERNEL_CELLS, cy + KERNEL_CELLS + 1):
            tile, place = _column(ix, iy, level.size)
            if level.layers[tile, place] & wanted == 0:
                continue
            for iz in range(z_low, z_high + 1):
                layer = iz & (LAYERS - 1)
                if level.tags[tile, layer, place] != _tag(ix, iy, iz, shift):
                    continue
                hit = level.hits[tile, layer, place]
                dx = ix * cell + hit[1] - x
                dy = iy * cell + hit[2] - y
                d2 = dx * dx + dy * dy
                if d2 > reach:
                    continue
                dz = iz * LAYER_M + hit[3] - z
                n = hit[0]
                w = math.exp(scale * d2 + z_scale * dz * dz) * n / (n + 1.0)
                wx, wy = w * dx, w * dy
                s0, s1, sx, sy, sz = s0 + w, s1 + w * w, sx + wx, sy + wy, sz + w * dz
                sxx, sxy, syy = sxx + wx * dx, sxy + wx * dy, syy + wy * dy
    sums[0], sums[1], sums[2], sums[3], sums[4] = s0, s1, sx, sy, sz
    sums[5], sums[6], sums[7] = sxx, sxy, syy
    return s0 > 1e-9


@nb.njit(cache=True, nogil=True)
def fit_line(
    level: Level, at: tuple[float, float, float], layered: bool, min_cells: float, sums: FloatArray, line: FloatArray
) -> bool:
    """Fit the wall near `at` (x, y, height) by a line with Gaussian weights; return whether the cells there support one.

    `layered`: look at the layers above and below, too (a planar scan has one). `sums` (8,) is room to work in. `line`,
    shape (LINE,), receives: centre x, y, normal x, y, scatter across the line (variance, m²), effective number
    of cells, [6] left to the caller, and by how much the cells lie lower than the point (m).
    """
    if not _gather(level, at[0], at[1], at[2], layered, sums):
        return False
    s0 = sums[0]
    effective = s0 * s0 / sums[1]
    # A line wants cells spread along it, and little beside it. Chords between a few sparse hits fit best where those beams
    # hit before: they pull the estimate towards standing still.
    if effective < min_cells:
        return False
    mx, my, mz = sums[2] / s0, sums[3] / s0, sums[4] / s0
    cxx, cxy, cyy = sums[5] / s0 - mx * mx, sums[6] / s0 - mx * my, sums[7] / s0 - my * my
    line[7] = -mz
    half_trace, half_difference = 0.5 * (cxx + cyy), 0.5 * (cxx - cyy)
    root = math.sqrt(half_difference * half_difference + cxy * cxy)
    small, large = max(half_trace - root, 0.0), half_trace + root
    if large < (0.7 * level.cell_m) ** 2 or small > 0.3 * large:
        return False
    # the normal by half-angle formulas: of the eigenvector of `small`
    cos2 = half_difference / root
    along_x, along_y = (
        math.sqrt(max(0.5 * (1.0 + cos2), 0.0)),
        math.copysign(math.sqrt(max(0.5 * (1.0 - cos2), 0.0)), cxy),
    )
    line[0], line[1], line[2], line[3] = at[0] + mx, at[1] + my, -along_y, along_x
    line[4], line[5] = small, effective
    return True
