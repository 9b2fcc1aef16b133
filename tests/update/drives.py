"""Logs of drives through a small mine: a drift with a bend, and, where it is there, a tunnel to the south."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from lhdmap.geometry import se2
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import FloatArray
from lhdmap.simulation.planar import (
    PlanarScanner,
    PlanarWorld,
    centre_line,
    poses_along,
    simulate_scans,
    world_from_polylines,
)

HALF_M, LONG_M, UP_M, BRANCH_M, DEEP_M = 2.25, 44.0, 28.0, 20.0, 18.0
RATE_HZ, SPEED_MPS = 10.0, 1.5
_SCANNER = PlanarScanner(field_of_view_deg=270.0, max_range_m=30.0)
_QUARTER = 0.5 * math.pi * 8.0


def mine(*, branch: bool, seed: int = 4, rough_m: float = 0.12) -> PlanarWorld:
    """The drift from (0, 0) to the east, then north; with `branch` a tunnel to the south at x = 20. Walls agree elsewhere."""
    h, x, y = HALF_M, LONG_M, UP_M
    south = [(-4.0, -h), (x + h, -h)]
    if branch:
        a, b, deep = BRANCH_M - h, BRANCH_M + h, -h - DEEP_M
        south = [(-4.0, -h), (a, -h), (a, deep), (b, deep), (b, -h), (x + h, -h)]
    outline = np.array([*south, (x + h, y), (x - h, y), (x - h, h), (-4.0, h), (-4.0, -h)])
    points = np.concatenate([np.linspace(a, b, round(float(np.hypot(*(b - a))) / 0.05)) for a, b in pairwise(outline)])
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(0.0, 2.5, (40, 2)), rng.uniform(0.0, 2.0 * np.pi, (40, 2))
    shift = np.sin((points @ waves.T)[:, :, None] + phases).sum(axis=1) * rough_m / math.sqrt(20.0)
    return world_from_polylines([points + shift], np.zeros((1, 3)))


def first_way() -> FloatArray:
    """The whole drift from west to north."""
    line = centre_line(((LONG_M - 8.0, 0.0), (_QUARTER, math.pi / 2), (UP_M - 11.0, 0.0)))
    return poses_along(line, np.arange(0.5, 0.02 * (len(line) - 1) - 0.5, SPEED_MPS / RATE_HZ))


def second_way() -> FloatArray:
    """From the drift's west into the tunnel to the south."""
    r = 7.0
    line = centre_line(((BRANCH_M - r, 0.0), (r * math.pi / 2, -math.pi / 2), (DEEP_M - r + HALF_M - 3.0, 0.0)))
    return poses_along(line, np.arange(0.5, 0.02 * (len(line) - 1) - 0.5, SPEED_MPS / RATE_HZ))


def write_drive(path: Path, world: PlanarWorld, way: FloatArray, seed: int = 1) -> Path:
    """Write the scans along a way as a log."""
    way = np.vstack([np.repeat(way[:1], 10, axis=0), way])
    with LogWriter(path) as writer:
        for scan in simulate_scans(world, way, _SCANNER, RATE_HZ, seed):
            writer.write("/lidar/front/scan", scan._replace(stamp_ns=scan.stamp_ns + seed * 10**13))
    return path


def north_way() -> FloatArray:
    """Out of the tunnel to the south, to the east, and north: it shares 40 m with the first way."""
    r, up = 7.0, DEEP_M + HALF_M - 3.0
    line = centre_line(
        (
            (up - r, 0.0),
            (r * math.pi / 2, -math.pi / 2),
            (LONG_M - BRANCH_M - 15.0, 0.0),
            (_QUARTER, math.pi / 2),
            (14.0, 0.0),
        )
    )
    way = poses_along(line, np.arange(0.5, 0.02 * (len(line) - 1) - 0.5, SPEED_MPS / RATE_HZ))
    start = np.array([BRANCH_M, -up, math.pi / 2])
    return np.array([se2.compose(start, pose) for pose in way])
