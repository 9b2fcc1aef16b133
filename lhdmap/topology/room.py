"""Room in the free space: how far it is from a point to the wall in a direction."""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.topology.sheet import Sheet

_STEPS_PER_CELL = 5.0
_PULLED_CELLS = 0.3  # beams are free up to a little before their hits: measured against known widths
MOST_M = 15.0
WALL_CELLS = _PULLED_CELLS + 0.5 / _STEPS_PER_CELL
"""How far walls are beyond the last free cells, on the average."""


class Room:
    """The free cells of a sheet, asked with rays."""

    def __init__(self, free: npt.NDArray[np.bool_], sheet: Sheet) -> None:
        self.free, self.sheet = np.ascontiguousarray(free), sheet

    def to_wall_m(self, points_m: FloatArray, directions: FloatArray, most_m: float = MOST_M) -> FloatArray:
        """Return the distances (N,) from points (N, 2) along unit vectors (N, 2) to where the free space ends."""
        step_m = self.sheet.cell_m / _STEPS_PER_CELL
        return _cast(
            self.free,
            np.ascontiguousarray(points_m, dtype=float),
            np.ascontiguousarray(directions, dtype=float),
            (float(self.sheet.origin_m[0]), float(self.sheet.origin_m[1]), self.sheet.cell_m, step_m, most_m),
        )

    def holds(self, points_m: FloatArray) -> npt.NDArray[np.bool_]:
        """Return whether points (N, 2) are in the free space."""
        cells = self.sheet.at(points_m)
        inside = ((cells >= 0) & (cells < self.free.shape)).all(axis=1)
        found = np.zeros(len(points_m), bool)
        found[inside] = self.free[cells[inside, 0], cells[inside, 1]]
        return found


@nb.njit(cache=True, nogil=True)
def _cast(
    free: npt.NDArray[np.bool_],
    points_m: FloatArray,
    directions: FloatArray,
    grid: tuple[float, float, float, float, float],
) -> FloatArray:
    x0, y0, cell_m, step_m, most_m = grid
    found = np.empty(len(points_m))
    for i in range(len(points_m)):
        at = 0.0
        while at < most_m:
            row = int(np.floor((points_m[i, 1] + at * directions[i, 1] - y0) / cell_m))
            column = int(np.floor((points_m[i, 0] + at * directions[i, 0] - x0) / cell_m))
            if not (0 <= row < free.shape[0] and 0 <= column < free.shape[1]) or not free[row, column]:
                break
            at += step_m
        found[i] = at + _PULLED_CELLS * cell_m
    return found
