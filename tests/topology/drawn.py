"""Drifts drawn into a grid, and drives through them: known geometry, and rays that are cast without the code under test."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.topology.build import Seen
from lhdmap.topology.graph import Scale
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet
from lhdmap.topology.views import Fan, View, thin
from scipy.ndimage import binary_dilation

CELL_M = 0.1
Drift = tuple[Sequence[tuple[float, float]], float]
"""A centre line and its width."""
SCALE = Scale(4.6, 1.0, 4.0, 6.5, 2.45, True)
"""Of a mine with drifts of 4.6 m and the machine of the papers."""
_REACH_M, _RAY_STEP_M, _RAYS = 25.0, 0.04, 540


class World:
    """Drifts with square ends, all that is within half a width of their lines."""

    def __init__(self, drifts: Sequence[Drift], rocks: Sequence[tuple[float, float, float, float]] = ()) -> None:
        """`rocks`: boxes (x, y, length, width) that stand in them."""
        points = np.array([point for line, _ in drifts for point in line], dtype=float)
        self.low = points.min(axis=0) - 12.0
        size = np.ceil((points.max(axis=0) + 12.0 - self.low) / CELL_M).astype(int)
        x, y = np.meshgrid(*((np.arange(n) + 0.5) * CELL_M + low for n, low in zip(size, self.low, strict=True)))
        self.free = np.zeros(x.shape, bool)
        for line, width in drifts:
            for a, b in itertools.pairwise(line):
                self.free |= _within(x, y, np.array(a, dtype=float), np.array(b, dtype=float), 0.5 * width)
        self._x, self._y = x, y
        for rock in rocks:
            self.free &= ~((np.abs(x - rock[0]) < 0.5 * rock[2]) & (np.abs(y - rock[1]) < 0.5 * rock[3]))

    def round_off(self, corner: tuple[float, float], along: FloatArray, other: FloatArray, radius_m: float) -> None:
        """Round the rock's corner between walls in the directions `along` and `other` (unit vectors) with a circle."""
        half = 0.5 * math.acos(float(along @ other))
        bisector = (along + other) / np.linalg.norm(along + other)
        centre = np.array(corner) + radius_m / math.sin(half) * bisector
        px, py = self._x - corner[0], self._y - corner[1]
        cross = along[0] * other[1] - along[1] * other[0]
        u, v = (px * other[1] - py * other[0]) / cross, (along[0] * py - along[1] * px) / cross
        tip = (
            (u >= 0)
            & (v >= 0)
            & (px * bisector[0] + py * bisector[1] < radius_m / math.sin(half) * math.cos(half) ** 2)
        )
        self.free |= tip & (np.hypot(self._x - centre[0], self._y - centre[1]) > radius_m)

    def sheet(self) -> Sheet:
        """Return the world as a sheet that was seen wholly: walls a cell thick, nothing beyond them."""
        cells = np.full(self.free.shape, UNKNOWN, np.uint8)
        cells[binary_dilation(self.free, np.ones((3, 3)))] = OCCUPIED
        cells[self.free] = FREE
        return Sheet(cells, self.low.copy(), CELL_M)

    def ranges_m(self, at: FloatArray, angles: FloatArray) -> FloatArray:
        """Return how far one sees from a point (2,) in each direction, at most 25 m."""
        s = np.arange(0.0, _REACH_M, _RAY_STEP_M)
        points = at + s[None, :, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None]
        column, row = np.moveaxis(np.floor((points - self.low) / CELL_M).astype(int), -1, 0)
        inside = (row >= 0) & (row < self.free.shape[0]) & (column >= 0) & (column < self.free.shape[1])
        blocked = ~(inside & self.free[np.where(inside, row, 0), np.where(inside, column, 0)])
        return np.where(blocked.any(axis=1), s[blocked.argmax(axis=1)], np.inf)


def _within(x: FloatArray, y: FloatArray, a: FloatArray, b: FloatArray, half_m: float) -> npt.NDArray[np.bool_]:
    way = (b - a) / np.linalg.norm(b - a)
    u, v = (x - a[0]) * way[0] + (y - a[1]) * way[1], (y - a[1]) * way[0] - (x - a[0]) * way[1]
    found: npt.NDArray[np.bool_] = (u >= 0) & (u <= np.linalg.norm(b - a)) & (np.abs(v) <= half_m)
    return found


def steps(line: Sequence[Sequence[float]], step_m: float = 0.25) -> FloatArray:
    """Return points (N, D) on a polyline, one each step."""
    points = np.array(line, dtype=float)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])
    wanted = np.arange(0.0, along[-1], step_m)
    return np.column_stack([np.interp(wanted, along, column) for column in points.T])


def fan_of(world: World, x: float, y: float, heading: float) -> Fan:
    """Return what a scanner that sees all around has at a pose, in its frame."""
    angles = np.linspace(-math.pi, math.pi, _RAYS, endpoint=False)
    ranges = world.ranges_m(np.array([x, y]), angles + heading)
    hit = np.isfinite(ranges)
    r, a = ranges[hit], angles[hit]
    hits = np.column_stack([r * np.cos(a), r * np.sin(a), np.ones(len(r))])
    return Fan(np.zeros(2), thin(hits))


def drive(
    worlds: World | Sequence[World],
    line: Sequence[Sequence[float]],
    said: Sequence[tuple[float, str]] = (),
    world_at: Sequence[tuple[float, int]] = ((0.0, 0),),
) -> Seen:
    """Return what a machine sees along a polyline (x, y or x, y, z).

    `said`: names and where along the way (m) each is begun to be said; `world_at`: which world it is in from where on.
    """
    many = [worlds] if isinstance(worlds, World) else list(worlds)
    points = steps(line)
    z = points[:, 2] if points.shape[1] > 2 else np.zeros(len(points))
    way = np.gradient(points[:, :2], axis=0)
    path = np.column_stack([points[:, :2], z, np.arctan2(way[:, 1], way[:, 0])])
    time_ns = (np.arange(len(path)) * 100_000_000).astype(np.int64)
    rows = range(0, len(path), 4)
    views = []
    for row in rows:
        number = [k for from_m, k in world_at if from_m <= 0.25 * row][-1]
        fan = fan_of(many[number], path[row, 0], path[row, 1], path[row, 3])
        views.append(View(int(time_ns[row]), 0.25 * row, (fan,)))
    words = [next((name for at, name in reversed(list(said)) if at <= 0.25 * row), "") for row in range(len(path))]
    return Seen(views, path[list(rows)], path, time_ns, words, Machine())
