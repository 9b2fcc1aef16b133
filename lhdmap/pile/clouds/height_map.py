"""A surface seen from above as a grid of heights, with the slope of each cell from a plane over the disc around it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

Mask = npt.NDArray[np.bool_]
RADIUS_SHARE = 0.05
"""Slopes are taken over discs of this share of the larger extent: 0.3 m on a heap of 6 m."""
_CELLS_IN_RADIUS = 3
_FEWEST_IN_DISC = 20
_WALL_RISE = 8.0


class HeightMap(NamedTuple):
    """Grid of I x J cells, x along the first index; NaN where nothing was seen.

    `height_m`: median height; `rise_m`: 5 to 95 % range of heights within the cell; `gradient` (I, J, 2): dz/dx, dz/dy;
    `roughness_m`: standard deviation of the points about the cell's plane; `origin_m` (2,): corner of cell (0, 0).
    """

    height_m: FloatArray
    rise_m: FloatArray
    gradient: FloatArray
    roughness_m: FloatArray
    origin_m: FloatArray
    cell_m: float
    radius_m: float

    @property
    def slope_deg(self) -> FloatArray:
        """Steepness of each cell (I, J), degrees, 0 ... 90."""
        return np.degrees(np.arctan(np.hypot(self.gradient[..., 0], self.gradient[..., 1])))

    @property
    def seen(self) -> Mask:
        """Cells with a height, shape (I, J)."""
        return np.isfinite(self.height_m)

    @property
    def walls(self) -> Mask:
        """Cells in which the surface rises far beyond their own size: sides of a box, not ore; shape (I, J)."""
        return np.nan_to_num(self.rise_m) > _WALL_RISE * self.cell_m

    def centers_m(self) -> FloatArray:
        """Return the middle of each cell, shape (I, J, 2)."""
        steps = np.indices(self.height_m.shape).transpose(1, 2, 0) + 0.5
        centers: FloatArray = self.origin_m + self.cell_m * steps
        return centers


def height_map(points_m: FloatArray, radius_m: float | None = None) -> HeightMap:
    """Return the surface of points (N, 3), metres, z up; N at least 1.

    `radius_m`: of the discs that slopes are from; by default a twentieth of the larger extent, more where points are sparse.
    """
    low, high = points_m[:, :2].min(axis=0), points_m[:, :2].max(axis=0)
    radius = radius_m or _radius(points_m, float((high - low).max()))
    cell = radius / _CELLS_IN_RADIUS
    index = np.floor((points_m[:, :2] - low) / cell).astype(np.int64)
    shape = (int(index[:, 0].max()) + 1, int(index[:, 1].max()) + 1)
    keys = index[:, 0] * shape[1] + index[:, 1]
    height, rise = (values.reshape(shape) for values in _quantiles(keys, points_m[:, 2], shape[0] * shape[1]))
    moments = _disc_sums(_moments(points_m, keys, shape, low, cell))
    gradient, roughness = _planes(moments, np.isfinite(height), cell)
    return HeightMap(height, rise, gradient, roughness, low, cell, radius)


def _radius(points_m: FloatArray, extent_m: float) -> float:
    """Return a twentieth of the extent, but no less than what holds some 30 points."""
    area = float(np.prod(np.maximum(np.ptp(points_m[:, :2], axis=0), 1e-6)))
    return max(RADIUS_SHARE * extent_m, float(np.sqrt(30.0 * area / (np.pi * len(points_m)))), 1e-6)


def _quantiles(keys: npt.NDArray[np.int64], z: FloatArray, cells: int) -> tuple[FloatArray, FloatArray]:
    """Return the median and the 5 to 95 % range of z in each cell, NaN where it is empty, shape (cells,) each."""
    order = np.lexsort((z, keys))
    sorted_keys, sorted_z = keys[order], z[order]
    used, first, count = np.unique(sorted_keys, return_index=True, return_counts=True)
    median, rise = np.full(cells, np.nan), np.full(cells, np.nan)
    median[used] = 0.5 * (sorted_z[first + (count - 1) // 2] + sorted_z[first + count // 2])
    last = first + count - 1
    rise[used] = sorted_z[last - (0.05 * count).astype(int)] - sorted_z[first + (0.05 * count).astype(int)]
    return median, rise


def _moments(
    points_m: FloatArray, keys: npt.NDArray[np.int64], shape: tuple[int, int], low: FloatArray, cell: float
) -> FloatArray:
    """Return sums over the points of each cell, shape (10, I, J): 1, x, y, z, xx, xy, yy, xz, yz, zz, about fixed points."""
    x, y = ((points_m[:, :2] - low) / cell).T
    z = points_m[:, 2] - points_m[:, 2].mean()
    terms = (np.ones(len(x)), x, y, z, x * x, x * y, y * y, x * z, y * z, z * z)
    size = shape[0] * shape[1]
    return np.stack([np.bincount(keys, weights=term, minlength=size).reshape(shape) for term in terms])


def _disc_sums(moments: FloatArray) -> FloatArray:
    """Return the sums over all cells whose middle is within the radius of each cell's, shape as given."""
    reach = _CELLS_IN_RADIUS
    padded = np.pad(moments, ((0, 0), (reach, reach), (reach, reach)))
    rows, columns = moments.shape[1:]
    total = np.zeros_like(moments)
    for di in range(-reach, reach + 1):
        for dj in range(-reach, reach + 1):
            if di * di + dj * dj <= reach * reach:
                total += padded[:, reach + di : reach + di + rows, reach + dj : reach + dj + columns]
    return total


def _planes(sums: FloatArray, seen: Mask, cell: float) -> tuple[FloatArray, FloatArray]:
    """Return gradient (I, J, 2) and standard deviation of the residuals (I, J) of the plane z = a + p x + q y in each disc."""
    n = np.maximum(sums[0], 1.0)
    mx, my, mz = sums[1] / n, sums[2] / n, sums[3] / n
    xx, xy, yy = sums[4] / n - mx * mx, sums[5] / n - mx * my, sums[6] / n - my * my
    xz, yz, zz = sums[7] / n - mx * mz, sums[8] / n - my * mz, sums[9] / n - mz * mz
    determinant = xx * yy - xy * xy
    known = seen & (sums[0] >= _FEWEST_IN_DISC) & (determinant > 0.05 * (0.5 * (xx + yy)) ** 2)
    safe = np.where(known, determinant, 1.0)
    p, q = (xz * yy - yz * xy) / safe, (yz * xx - xz * xy) / safe
    rest = np.sqrt(np.maximum(zz - p * xz - q * yz, 0.0))
    gradient = np.stack([p, q], axis=-1) / cell
    return np.where(known[..., None], gradient, np.nan), np.where(known, rest, np.nan)
