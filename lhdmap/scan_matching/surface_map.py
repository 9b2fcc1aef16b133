"""The local map that scans are matched against: hits averaged in cells of three sizes, walls as moving-least-squares lines.

Each level is a grid that wraps around, in tiles of 8 x 8 cells for each layer of height (a tag tells which place of the world
a tile holds). Only tiles with hits have a block of memory; blocks are used in turn, so memory is fixed and the oldest places
are forgotten. Coarse levels serve sparse, distant walls and starts. A tilted scanner sees a wall at another height from each
distance, and rock is rough in height, too: the line at a point is the wall's at the height of that point.

A bit for each cell with hits, and the four numbers of a cell in one, would save a seventh of the time of a fit, at most 2 %
of a run: docs/notes/weighed.md.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

KERNEL_CELLS = 3  # a line is fitted to the cells within this many cells of a point
KERNEL_SIGMA_CELLS = 2.0
# Columns of a line, as `fit_line` gives it: centre (m), unit normal, variance across the line (m²), effective number of cells,
# cell of the level that served (m; 0: none; left to the caller), and by how much the cells lie lower than the point (m).
CENTRE_X, CENTRE_Y, NORMAL_X, NORMAL_Y, SCATTER, CELLS, SERVED, BELOW = range(8)
LINE = 8
_CLUSTER_SHARE = 0.1  # of the variance along a line: from which on what scatters across it is a degenerate cluster
_CLUSTER_WIDER = 9.0  # times that variance: what a degenerate cluster is taken to scatter by
LAYERS = 8
LAYER_M = 0.12
_LAYERS_PER_M = 1.0 / LAYER_M  # one expression for all: a height between two layers falls into one
_HEIGHT_SIGMA_M = 0.06
_HEIGHT_PER_CELL = 1.5  # ... and at least so many cells: measured, a third less heading drift of a tilted scanner
_FINE_M = 0.05
_STEPS = 65536.0  # a mean is kept in so many steps of its cell: below a micrometre in fine cells
X, Y, Z, COUNT = range(4)  # columns of `hits`


class Level(NamedTuple):
    """One grid of `size` x `size` columns of cells, which wraps around; T = (size / 8)² tiles.

    `tags` (T, LAYERS) int32: the place of the world (0: none); `blocks` (T, LAYERS) int32: which block of `hits` is theirs.
    `hits` (N, 64, 4) uint16: of each cell the mean offset x, y, z from its corner, in 1 / 65536 of its size, and the count.
    `owners` (N,) int32: tile * LAYERS + layer of each block; `used` (1,): blocks taken so far.
    """

    cell_m: float
    size: int
    tags: npt.NDArray[np.int32]
    blocks: npt.NDArray[np.int32]
    owners: npt.NDArray[np.int32]
    hits: npt.NDArray[np.uint16]
    used: npt.NDArray[np.int64]


class SurfaceMap(NamedTuple):
    """Grids from fine to coarse that hold the same hits."""

    fine: Level
    middle: Level
    coarse: Level


def empty_map(cell_m: float, cells: int = 2048) -> SurfaceMap:
    """Return an empty map with cells of `cell_m`, 3 x and 9 x that; the fine window is `cells * cell_m` wide."""
    return SurfaceMap(_level(cell_m, cells), _level(3 * cell_m, cells // 2), _level(9 * cell_m, cells // 4))


def _level(cell_m: float, cells: int) -> Level:
    # zeros are mapped lazily by the operating system: only pages that walls touch take memory
    tiles = (cells // 8) ** 2
    return Level(
        cell_m,
        cells,
        np.zeros((tiles, LAYERS), np.int32),
        np.zeros((tiles, LAYERS), np.int32),
        np.zeros(tiles, np.int32),
        np.zeros((tiles, 64, 4), np.uint16),
        np.zeros(1, np.int64),
    )


@nb.njit(cache=True, nogil=True, inline="always")
def _tag(ix: int, iy: int, iz: int, shift: int) -> int:
    """Return a tag, never 0, that tells the tile of cell (ix, iy, iz) from those that share its place in the window; 31 bits."""
    return (((ix >> shift) & 0x3FF) << 20 | ((iy >> shift) & 0xFFF) << 8 | ((iz >> 3) & 0xFF)) + 1


@nb.njit(cache=True, nogil=True, inline="always")
def _tile(ix: int, iy: int, size: int) -> int:
    """Return the tile of the column (ix, iy) in a window of `size`."""
    return ((ix & (size - 1)) >> 3) * (size >> 3) + ((iy & (size - 1)) >> 3)


@nb.njit(cache=True, nogil=True)
def _begin(level, tile, layer, tag):  # type: ignore[no-untyped-def]
    """Give a tile to another place of the world, with an empty block: the one whose turn it is."""
    if level.tags[tile, layer] == 0:
        block = level.used[0] % level.owners.shape[0]
        level.used[0] += 1
        owner = level.owners[block]
        if level.blocks[owner // LAYERS, owner % LAYERS] == block:
            level.tags[owner // LAYERS, owner % LAYERS] = 0
        level.owners[block] = tile * LAYERS + layer
        level.blocks[tile, layer] = block
    level.tags[tile, layer] = tag
    level.hits[level.blocks[tile, layer]] = 0


@nb.njit(cache=True, nogil=True, inline="always")
def _averaged(step: int, offset: float, inverse_n: float) -> int:
    """Return a mean (steps of a cell) with one more offset (share of a cell) in it, the n-th."""
    mean = step + (offset * _STEPS - step) * inverse_n
    return int(min(max(mean + 0.5, 0.0), _STEPS - 1.0))


@nb.njit(cache=True, nogil=True)
def insert(level: Level, points_m: FloatArray, count_limit: float) -> None:
    """Average points, shape (N, 3), map frame, into their cells; beyond `count_limit` hits the mean forgets the oldest."""
    shift = int(round(math.log2(level.size)))
    inverse = 1.0 / level.cell_m
    for i in range(points_m.shape[0]):
        fx, fy, fz = points_m[i, 0] * inverse, points_m[i, 1] * inverse, points_m[i, 2] * _LAYERS_PER_M
        if not (abs(fx) < 1e8 and abs(fy) < 1e8 and abs(fz) < 1e6):
            continue
        ix, iy, iz = int(math.floor(fx)), int(math.floor(fy)), int(math.floor(fz))
        tile, place, layer = _tile(ix, iy, level.size), (ix & 7) << 3 | (iy & 7), iz & (LAYERS - 1)
        tag = _tag(ix, iy, iz, shift)
        if level.tags[tile, layer] != tag:
            _begin(level, tile, layer, tag)
        hit = level.hits[level.blocks[tile, layer], place]
        n = min(hit[COUNT] + 1.0, count_limit)
        inverse_n = 1.0 / n
        hit[X] = _averaged(hit[X], fx - ix, inverse_n)
        hit[Y] = _averaged(hit[Y], fy - iy, inverse_n)
        hit[Z] = _averaged(hit[Z], fz - iz, inverse_n)
        hit[COUNT] = int(n)


@nb.njit(cache=True, nogil=True)
def insert_all(map_: SurfaceMap, points_m: FloatArray, count_limit: float) -> None:
    """Insert points, shape (N, 3), map frame, into all levels."""
    insert(map_.fine, points_m, count_limit)
    insert(map_.middle, points_m, count_limit)
    insert(map_.coarse, points_m, count_limit)


@nb.njit(cache=True, nogil=True, inline="always")
def _neighbours(level: Level, z: float, layered: bool) -> tuple[int, int]:
    """Return the first and the last layer to look at: coarse cells serve distant walls, seen at many heights."""
    own = int(math.floor(z * _LAYERS_PER_M))
    if not layered:
        return own, own
    if level.cell_m > _FINE_M:
        return own - 1, own + 1
    return (own - 1, own) if z * _LAYERS_PER_M - own < 0.5 else (own, own + 1)


@nb.njit(cache=True, nogil=True)
def _gather(level: Level, x: float, y: float, z: float, layered: bool, sums: FloatArray) -> bool:
    """Add up the cells around (x, y, z) with Gaussian weights; False where there are none.

    `sums`, shape (8,), receives: weights, squared weights, x, y, z, xx, xy, yy about the point.
    """
    shift, cell = int(round(math.log2(level.size))), level.cell_m
    cx, cy = int(math.floor(x / cell)), int(math.floor(y / cell))
    z_low, z_high = _neighbours(level, z, layered)
    scale, z_scale = -0.5 / (KERNEL_SIGMA_CELLS * cell) ** 2, -0.5 / max(_HEIGHT_SIGMA_M, _HEIGHT_PER_CELL * cell) ** 2
    reach, step_m, layer_step_m = (KERNEL_CELLS * cell) ** 2, cell / _STEPS, LAYER_M / _STEPS
    s0 = s1 = sx = sy = sz = sxx = sxy = syy = 0.0
    for tile_ix in range((cx - KERNEL_CELLS) & ~7, cx + KERNEL_CELLS + 1, 8):
        for tile_iy in range((cy - KERNEL_CELLS) & ~7, cy + KERNEL_CELLS + 1, 8):
            tile = _tile(tile_ix, tile_iy, level.size)
            for iz in range(z_low, z_high + 1):
                layer = iz & (LAYERS - 1)
                if level.tags[tile, layer] != _tag(tile_ix, tile_iy, iz, shift):
                    continue
                block, z_m = level.hits[level.blocks[tile, layer]], iz * LAYER_M - z
                for ix in range(max(tile_ix, cx - KERNEL_CELLS), min(tile_ix + 7, cx + KERNEL_CELLS) + 1):
                    for iy in range(max(tile_iy, cy - KERNEL_CELLS), min(tile_iy + 7, cy + KERNEL_CELLS) + 1):
                        hit = block[(ix - tile_ix) << 3 | (iy - tile_iy)]
                        if hit[COUNT] == 0:
                            continue
                        dx = ix * cell - x + hit[X] * step_m
                        dy = iy * cell - y + hit[Y] * step_m
                        d2 = dx * dx + dy * dy
                        if d2 > reach:
                            continue
                        dz = z_m + hit[Z] * layer_step_m
                        n = float(hit[COUNT])
                        w = math.exp(scale * d2 + z_scale * dz * dz) * n / (n + 1.0)
                        wx, wy = w * dx, w * dy
                        s0, s1, sx, sy, sz = s0 + w, s1 + w * w, sx + wx, sy + wy, sz + w * dz
                        sxx, sxy, syy = sxx + wx * dx, sxy + wx * dy, syy + wy * dy
    sums[0], sums[1], sums[2], sums[3], sums[4] = s0, s1, sx, sy, sz
    sums[5], sums[6], sums[7] = sxx, sxy, syy
    return s0 > 1e-9


@nb.njit(cache=True, nogil=True)
def fit_line(
    level: Level,
    at: tuple[float, float, float],
    layered: bool,
    wanted: tuple[float, float],
    sums: FloatArray,
    line: FloatArray,
) -> bool:
    """Fit the wall near `at` (x, y, height) by a line with Gaussian weights; return whether the cells there support one.

    `layered`: look at the layers above and below, too (a planar scan has one). `wanted`: effective cells that a line needs,
    and the variance (m²) that noise alone gives: few far hits that scatter no more are a degenerate cluster, whose direction is
    noise; it agrees with all that is near, and says hardly anything (0: none is one). `sums` (8,) is room to work in.
    `line`, shape (LINE,), receives the columns above but `SERVED`.
    """
    if not _gather(level, at[0], at[1], at[2], layered, sums):
        return False
    s0 = sums[0]
    effective = s0 * s0 / sums[1]
    # A line wants cells spread along it, and little beside it. Chords between a few sparse hits fit best where those beams
    # hit before: they pull the estimate towards standing still.
    if effective < wanted[0]:
        return False
    mx, my, mz = sums[2] / s0, sums[3] / s0, sums[4] / s0
    cxx, cxy, cyy = sums[5] / s0 - mx * mx, sums[6] / s0 - mx * my, sums[7] / s0 - my * my
    line[BELOW] = -mz
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
    line[CENTRE_X], line[CENTRE_Y], line[NORMAL_X], line[NORMAL_Y] = at[0] + mx, at[1] + my, -along_y, along_x
    degenerate = small > _CLUSTER_SHARE * large and small < wanted[1]
    line[SCATTER], line[CELLS] = _CLUSTER_WIDER * large if degenerate else small, effective
    return True
