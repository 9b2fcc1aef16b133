"""The floor under a heap: a plane where it is seen, otherwise the level of the lowest points that others confirm."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.pile.height_map import HeightMap

_FLAT_DEG = 8.0
_FLOOR_SHARE = 0.15
_LOWEST_SHARE = 1e-4
_FEWEST_LOWEST = 4


class Floor(NamedTuple):
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


def find_floor(points_m: FloatArray, surface: HeightMap) -> Floor:
    """Return the floor of points (N, 3), z up, with their height map.

    Where at least 15 % of the cells are level and lie together at the bottom, it is the robust plane through them. A heap that
    covers its floor shows only points of it, between rocks: then the floor is level at the lowest points that are confirmed
    (as many as 1 in 10,000, at least 4), and the standard deviation is how far the lowest hundredth lies above them.
    """
    plane = _seen_plane(surface)
    return plane if plane is not None else _lowest_level(points_m[:, 2])


def _seen_plane(surface: HeightMap) -> Floor | None:
    level = surface.seen & (np.nan_to_num(surface.slope_deg, nan=90.0) < _FLAT_DEG) & ~surface.walls
    if np.count_nonzero(level) < 3:
        return None
    z, xy = surface.height_m[level], surface.centers_m()[level]
    heights = surface.height_m[surface.seen]
    reach = max(0.1 * float(np.percentile(heights, 98) - np.percentile(heights, 2)), surface.cell_m)
    low = z < np.percentile(z, 5.0) + 2.0 * reach
    if np.count_nonzero(low) < _FLOOR_SHARE * np.count_nonzero(surface.seen):
        return None
    values, used = _plane(xy[low], z[low])
    rest = z[low][used] - (values[0] + xy[low][used] @ values[1:])
    # Neighbouring cells share their points: a disc of them counts once.
    independent = max(np.count_nonzero(used) * (surface.cell_m / surface.radius_m) ** 2 / math.pi, 1.0)
    std = float(np.std(rest)) / math.sqrt(independent)
    return Floor(float(values[0]), float(values[1]), float(values[2]), std, "plane through its level cells")


def _plane(xy: FloatArray, z: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Return offset and slopes (3,) of a plane, and the places (N,) it was fitted to: those within 2.5 deviations."""
    design = np.column_stack([np.ones(len(z)), xy])
    used = np.ones(len(z), dtype=bool)
    values = np.zeros(3)
    for _ in range(6):
        values = np.linalg.lstsq(design[used], z[used], rcond=None)[0].astype(np.float64)
        rest = z - design @ values
        spread = 1.4826 * float(np.median(np.abs(rest[used] - np.median(rest[used]))))
        used = np.abs(rest) <= max(2.5 * spread, 1e-9)
        if np.count_nonzero(used) < 3:
            return values, np.ones(len(z), dtype=bool)
    return values, used


def _lowest_level(z: FloatArray) -> Floor:
    count = min(max(_FEWEST_LOWEST, round(_LOWEST_SHARE * len(z))), len(z))
    lowest = np.partition(z, count - 1)[:count]
    height = float(np.median(lowest))
    std = float(np.percentile(z, 1.0)) - height
    return Floor(height, 0.0, 0.0, max(std, float(np.std(lowest))), "lowest points, the floor itself is covered")
