"""The floor under a heap: a plane where it is seen, otherwise the level of the lowest points that others confirm."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry.plane import MAD_TO_STD, Weights, robust_plane
from lhdmap.messages import FloatArray
from lhdmap.pile.clouds.height_map import HeightMap

_FLAT_DEG = 8.0
_ROUNDS = 6  # of the plane through the level cells
_OFF_SIGMAS, _NO_SPREAD_M = 2.5, 1e-9  # a cell farther off is no floor; of cells that lie in one plane exactly
_FLOOR_SHARE = 0.15
_LOWEST_SHARE = 1e-4
_FEWEST_LOWEST = 4


class HeapFloor(NamedTuple):
    """z = height + slope_x x + slope_y y; standard deviation of its height (m); how it was found, in words."""

    height_m: float
    slope_x: float
    slope_y: float
    std_m: float
    source: str

    def at(self, xy_m: FloatArray) -> FloatArray:
        """Return the floor's height at places (..., 2), metres."""
        z: FloatArray = self.height_m + self.slope_x * xy_m[..., 0] + self.slope_y * xy_m[..., 1]
        return z


def find_floor(points_m: FloatArray, surface: HeightMap) -> HeapFloor:
    """Return the floor of points (N, 3), z up, with their height map.

    Where at least 15 % of the cells are level and lie together at the bottom, it is the robust plane through them. A heap that
    covers its floor shows only points of it, between rocks: then the floor is level at the lowest points that are confirmed
    (as many as 1 in 10,000, at least 4), and the standard deviation is how far the lowest hundredth lies above them.
    """
    plane = _seen_plane(surface)
    return plane if plane is not None else _lowest_level(points_m[:, 2])


def _seen_plane(surface: HeightMap) -> HeapFloor | None:
    level = surface.seen & (np.nan_to_num(surface.slope_deg, nan=90.0) < _FLAT_DEG) & ~surface.walls
    if np.count_nonzero(level) < 3:
        return None
    z, xy = surface.height_m[level], surface.centers_m()[level]
    heights = surface.height_m[surface.seen]
    reach = max(0.1 * float(np.percentile(heights, 98) - np.percentile(heights, 2)), surface.cell_m)
    low = z < np.percentile(z, 5.0) + 2.0 * reach
    if np.count_nonzero(low) < _FLOOR_SHARE * np.count_nonzero(surface.seen):
        return None
    start = np.ones(np.count_nonzero(low), dtype=bool)
    values, used, _ = robust_plane(xy[low], z[low], _near, _ROUNDS, start)
    rest = z[low][used] - (values[0] + xy[low][used] @ values[1:])
    # Neighbouring cells share their points: a disc of them counts once.
    independent = max(np.count_nonzero(used) * (surface.cell_m / surface.radius_m) ** 2 / math.pi, 1.0)
    std = float(np.std(rest)) / math.sqrt(independent)
    return HeapFloor(float(values[0]), float(values[1]), float(values[2]), std, "plane through its level cells")


def _near(residuals: FloatArray, used: Weights) -> Weights | None:
    """Return which places (N,) are within some deviations of those used before."""
    rest = residuals[used]
    spread = MAD_TO_STD * float(np.median(np.abs(rest - np.median(rest))))
    near: npt.NDArray[np.bool_] = np.abs(residuals) <= max(_OFF_SIGMAS * spread, _NO_SPREAD_M)
    return near if np.count_nonzero(near) >= 3 else None


def _lowest_level(z: FloatArray) -> HeapFloor:
    count = min(max(_FEWEST_LOWEST, round(_LOWEST_SHARE * len(z))), len(z))
    lowest = np.partition(z, count - 1)[:count]
    height = float(np.median(lowest))
    std = float(np.percentile(z, 1.0)) - height
    return HeapFloor(height, 0.0, 0.0, max(std, float(np.std(lowest))), "lowest points, the floor itself is covered")
