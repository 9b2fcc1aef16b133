"""Triangles sorted into a sparse grid: each is in the cell of its middle, large ones are cut until they are small."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray

CELL_M = 0.4
_ROUNDING_M = 1e-4  # single precision, hundreds of metres from the corner of a piece
_LARGEST_M = 0.2  # from the middle of a triangle to its farthest corner


class Grid(NamedTuple):
    """Triangles by cells. Cells are sorted by row (index along x), then column (y), then height (z).

    Coordinates are less `origin_m` (3,); `spheres` (N, 4): middle and radius; `corners` (N, 3, 3); `radius_m` the largest;
    `row_first` (rows + 1,) leads to the cells of a row, `first` (cells + 1,) to the triangles of a cell. `discs` (cells, 8):
    what a cell has lies in a flat disc: middle, normal, half its thickness, radius.
    """

    bounds_m: FloatArray
    origin_m: FloatArray
    radius_m: float
    row_first: npt.NDArray[np.int32]
    column: npt.NDArray[np.int32]
    height: npt.NDArray[np.int32]
    first: npt.NDArray[np.int32]
    discs: FloatArray
    spheres: Float32Array
    corners: Float32Array


def build_grid(corners_m: FloatArray) -> Grid:
    """Return the grid of triangles given by their corners in `map`, shape (M, 3, 3)."""
    corners = np.asarray(corners_m, dtype=float).reshape(-1, 3, 3)
    flat = corners.reshape(-1, 3)
    bounds = np.stack([flat.min(axis=0), flat.max(axis=0)]) if len(flat) else np.zeros((2, 3))
    local = _cut(corners - bounds[0])
    middle = local.mean(axis=1)
    radius = np.linalg.norm(local - middle[:, None], axis=2).max(axis=1, initial=0.0) + _ROUNDING_M
    cells = np.floor(middle / CELL_M).astype(np.int32)
    order = np.lexsort((cells[:, 2], cells[:, 1], cells[:, 0]))
    cells = cells[order]
    new = np.ones(len(cells), dtype=bool)
    new[1:] = (cells[1:] != cells[:-1]).any(axis=1)
    starts = np.flatnonzero(new)
    local, first = local[order], np.append(starts, len(cells)).astype(np.int32)
    rows = int(cells[-1, 0]) + 1 if len(cells) else 0
    return Grid(
        bounds_m=bounds,
        origin_m=bounds[0],
        radius_m=float(radius.max(initial=0.0)),
        row_first=np.searchsorted(cells[starts, 0], np.arange(rows + 1)).astype(np.int32),
        column=np.ascontiguousarray(cells[starts, 1]),
        height=np.ascontiguousarray(cells[starts, 2]),
        first=first,
        discs=_discs(local, first),
        spheres=np.column_stack([middle, radius])[order].astype(np.float32),
        corners=local.astype(np.float32),
    )


def _discs(corners: FloatArray, first: npt.NDArray[np.int32]) -> FloatArray:
    """Return the flattest disc around the triangles of each cell, shape (cells, 8)."""
    counts = np.diff(first)
    if not len(counts):
        return np.empty((0, 8))
    cell = np.repeat(np.arange(len(counts)), counts)
    middle = np.add.reduceat(corners.mean(axis=1), first[:-1]) / counts[:, None]
    off = corners - middle[cell][:, None]
    spread = np.add.reduceat(np.einsum("nia,nib->nab", off, off), first[:-1])
    normal = np.linalg.eigh(spread)[1][:, :, 0]
    over = np.einsum("nia,na->ni", off, normal[cell])
    aside = np.sqrt(np.maximum((off * off).sum(axis=2) - over * over, 0.0))
    sizes = [np.maximum.reduceat(np.abs(part).max(axis=1), first[:-1]) + _ROUNDING_M for part in (over, aside)]
    return np.column_stack([middle, normal, *sizes])


def _cut(corners: FloatArray) -> FloatArray:
    """Return triangles, none larger than `_LARGEST_M`: each longest edge is halved until they are so."""
    done: list[FloatArray] = []
    while len(corners):
        middle = corners.mean(axis=1, keepdims=True)
        large = np.linalg.norm(corners - middle, axis=2).max(axis=1) > _LARGEST_M
        done.append(corners[~large])
        corners = _halved(corners[large])
    return np.concatenate(done) if done else corners


def _halved(corners: FloatArray) -> FloatArray:
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = (np.argmax(edges, axis=1)[:, None] + np.arange(3)) % 3  # the longest edge leads from corner 0 to 1
    a, b, c = np.moveaxis(np.take_along_axis(corners, turn[:, :, None], axis=1), 1, 0)
    half = 0.5 * (a + b)
    return np.concatenate([np.stack([a, half, c], axis=1), np.stack([half, b, c], axis=1)])
