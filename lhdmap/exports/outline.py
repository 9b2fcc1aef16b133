"""Walls: the outlines of a sheet's free space, as lines with heights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.exports.lines import thinned
from lhdmap.messages import FloatArray
from lhdmap.topology.sheet import FREE, Sheet

SMOOTH_CELLS = 0.75
"""How far the drawn wall may leave the cells' edges. Assumed: takes the stairs out of oblique walls, keeps corners."""
SMOOTH_HEIGHT_M = 0.1
"""How far its height may leave the floor's. Assumed: twice what a floor's bumps are."""
LEAST_CELLS = 4.0
"""Spots of fewer cells are noise and not drawn. Assumed."""
_LEVEL_M = 2.0  # beyond a sheet's lowest and highest floor, lines are another level's


class Floor(NamedTuple):
    """Where the floor is: points (N, 3) along all lines that are driven, in `map`."""

    points_m: FloatArray

    def heights_m(self, plan_m: FloatArray, sheet: Sheet) -> FloatArray:
        """Return the height (M,) of the nearest floor point of the sheet's level, the sheet's own where there is none."""
        from scipy.spatial import cKDTree

        low, high = sheet.heights_m
        z = self.points_m[:, 2]
        here = self.points_m[(z >= low - _LEVEL_M) & (z <= high + _LEVEL_M)]
        if not len(here):
            return np.full(len(plan_m), sheet.height_m)
        heights: FloatArray = here[cKDTree(here[:, :2]).query(plan_m)[1], 2]
        return heights


def floor_of(lines_m: Sequence[FloatArray], step_m: float = 0.25) -> Floor:
    """Return the floor along lines (N, 3), with a point each step."""
    parts = [np.zeros((0, 3)), *(_dense(line, step_m) for line in lines_m if len(line))]
    return Floor(np.concatenate(parts))


def outlines(sheet: Sheet) -> list[FloatArray]:
    """Return the closed lines (N, 2) round the free space of a sheet and what stands in it, in `map`.

    They run between free and other cells, half-way between the cells' middles; the first and the last point are one.
    """
    from skimage.measure import find_contours

    free = np.pad((sheet.cells == FREE).astype(np.uint8), 1)
    found = []
    for ring in find_contours(free, 0.5):  # type: ignore[no-untyped-call]
        plan = sheet.origin_m + (ring[:, ::-1] - 0.5) * sheet.cell_m
        if abs(_area_m2(plan)) >= LEAST_CELLS * sheet.cell_m**2:
            found.append(plan)
    return found


def walls(sheet: Sheet, floor: Floor) -> list[FloatArray]:
    """Return the outlines (N, 3) at the height of the floor beside them, in `map`, with as few points as show both."""
    smooth_m = SMOOTH_CELLS * sheet.cell_m
    found = []
    for plan in outlines(sheet):
        line = np.column_stack([plan, floor.heights_m(plan, sheet)])
        found.append(line[thinned(line * (1.0, 1.0, smooth_m / SMOOTH_HEIGHT_M), smooth_m)])
    return found


def _area_m2(ring_m: FloatArray) -> float:
    near = ring_m - ring_m[0]
    return 0.5 * float(np.sum(near[:-1, 0] * near[1:, 1] - near[1:, 0] * near[:-1, 1]))


def _dense(line_m: FloatArray, step_m: float) -> FloatArray:
    """Return the line with points at most a step apart."""
    lengths = np.linalg.norm(np.diff(line_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    at = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / step_m)) + 1)
    return np.column_stack([np.interp(at, along, line_m[:, axis]) for axis in range(3)])
