"""Piles on a level floor between two walls, for tests."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.field import ACROSS_M, ALONG_M, Bools, Grid
from lhdmap.simulation.ground.heap import Heap

TOE_M, HALF_M = 20.0, 2.6
"""The toe is at x = 20, walls are at y = ±2.6; the drift ends at x = 32."""
SLOPE = math.tan(math.radians(48.0))


def inside(points_m: FloatArray, y_m: float = 0.0) -> Bools:
    x, y = points_m[..., 0], points_m[..., 1] - y_m
    found: Bools = (np.abs(y) < HALF_M) & (x > TOE_M - 8.0) & (x < 32.0)
    return found


def level(points_m: FloatArray) -> FloatArray:
    return np.zeros(points_m.shape[:-1])


def heap(*, fed: bool = False, rough_m: float = 0.0, crest_m: float = 3.5, y_m: float = 0.0) -> Heap:
    """`y_m`: of the middle of its drift."""
    grid = Grid(TOE_M - 6.0, y_m - 2.95, 0.0, (round(18.0 / ALONG_M), round(6.0 / ACROSS_M)))
    x = grid.points()[:, :, 0] - TOE_M
    heights = np.clip(SLOPE * x, 0.0, crest_m)
    heights += np.where(heights > 0.3, rough_m * np.random.default_rng(1).standard_normal(heights.shape), 0.0)
    return Heap(grid, heights, SLOPE, partial(inside, y_m=y_m), level, fed=fed)
