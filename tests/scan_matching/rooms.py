"""Places whose walls are known: a hall, a corridor whose niches repeat, a smooth corridor; scans in them and submaps of them."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.submap import Submap
from lhdmap.simulation.planar import PlanarScanner, PlanarWorld, simulate_scans, world_from_polylines

CELL_M = 0.04
SCANNER = PlanarScanner(field_of_view_deg=270.0)
SHORT = PlanarScanner(field_of_view_deg=270.0, max_range_m=9.0)  # sees no end of a corridor
NICHE_M = 4.0  # from one niche to the next


@functools.lru_cache(maxsize=1)
def hall() -> PlanarWorld:
    """A hall of 12 m by 8 m with a niche, a pillar and an oblique corner: it looks like itself from nowhere else."""
    walls = [(-6, -4), (6, -4), (6, 1), (3, 4), (1, 4), (1, 6), (-1, 6), (-1, 4), (-6, 4), (-6, -4)]
    pillar = [(-3, -1), (-2, -1), (-2, 0), (-3, 0), (-3, -1)]
    return _world(walls, pillar)


@functools.lru_cache(maxsize=1)
def repeating() -> PlanarWorld:
    """A corridor of 4 m width along x with a niche each `NICHE_M`, from -30 m to 30 m."""
    left = [
        (x + dx, y) for x in np.arange(-30.0, 30.0, NICHE_M) for dx, y in ((0, 2), (1, 2), (1, 2.8), (2, 2.8), (2, 2))
    ]
    return _world(left, [(-30, -2), (30, -2)])


@functools.lru_cache(maxsize=1)
def smooth() -> PlanarWorld:
    """Two straight walls along x, 4 m apart, from -30 m to 30 m."""
    return _world([(-30, 2), (30, 2)], [(-30, -2), (30, -2)])


def _world(*walls: Sequence[tuple[float, float]]) -> PlanarWorld:
    return world_from_polylines([np.array(wall, dtype=float) for wall in walls], np.zeros((1, 3)))


def scans(world: PlanarWorld, poses: FloatArray, scanner: PlanarScanner = SCANNER, seed: int = 1) -> list[FloatArray]:
    """Return the hits (N, 3) of noisy scans at poses (K, 3), each in its own frame."""
    made = simulate_scans(world, np.vstack([poses, poses[-1:]]), scanner, 10.0, seed)[:-1]
    return [planar_points(scan, np.eye(4), np.zeros(3)) for scan in made]


def seen(world: PlanarWorld, pose: FloatArray, scanner: PlanarScanner = SCANNER, seed: int = 99) -> Hits:
    """Return a noisy scan at a pose (3,)."""
    points = scans(world, pose[None], scanner, seed)[0]
    return Hits(points, len(points), layered=False)


def mapped(world: PlanarWorld, poses: FloatArray, scanner: PlanarScanner = SCANNER) -> Submap:
    """Return the submap of scans at known poses (K, 3)."""
    submap = Submap(CELL_M, window_cells=1024)
    for pose, points in zip(poses, scans(world, poses, scanner), strict=True):
        submap.insert(points, pose)
    return submap


def walk(start_m: float, end_m: float, count: int) -> FloatArray:
    """Return poses (K, 3) along x."""
    return np.column_stack([np.linspace(start_m, end_m, count), np.zeros(count), np.zeros(count)])


def off(true: FloatArray, found: FloatArray) -> tuple[float, float]:
    """Return how far a pose is from the true one: metres and degrees."""
    error = se2.between(true, found)
    return float(np.hypot(error[0], error[1])), abs(math.degrees(error[2]))


def near(true: FloatArray, found: FloatArray, most_m: float, most_deg: float) -> bool:
    """Return whether a pose is the true one, within metres and degrees."""
    away_m, turn_deg = off(true, found)
    return away_m < most_m and turn_deg < most_deg
