"""The pile of a draw point: a field of heights on the drift's floor that is dug along any heading, and seen as a mesh."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.ground.field import ACROSS_M, ALONG_M, CELL_M2, Bools, Grid, slide_field, spread_back, turned
from lhdmap.simulation.pile_face import sheet

_STANDS_M = 1e-3
_SEEN_M = 1e-3  # changes of a height that scanners are shown
_FED_M = 0.6  # of the far end: it stays as high as it was, ore comes from the stope
_SHOWN_M = 0.03
_BURIED_M = 0.08  # how far the mesh is under the floor where there is no ore
_EVERY = 2  # cells along of a cell of the mesh
_SWEEPS = 8.0  # for each of the side view's time constants: a field needs more for the same way
_MOST_SWEEPS = 1500
_NO_BUCKET = (0, -1, 0, 0)

Inside = Callable[[FloatArray], Bools]
"""Says which of points (..., 2) of `map` are in the drift and not in rock."""
FloorAt = Callable[[FloatArray], FloatArray]
"""Floor's height (...,) at points (..., 2) of `map`."""


class _Around(NamedTuple):
    """Which cells are in the drift, the floor's height in them, and which are the far end; all (N, M)."""

    open_cells: Bools
    floor_m: FloatArray
    far_end: Bools


class _Layers(NamedTuple):
    """What goes with the cells, (N, M): stones over the smooth surface, heights that are fed, heights before any digging."""

    stones_m: FloatArray
    fed_m: FloatArray
    was_m: FloatArray


class Heap:
    """A pile that changes. `heights_m` (N, M) are over the floor in the cells of `grid`; `came_m3` has come from behind."""

    def __init__(
        self, grid: Grid, heights_m: FloatArray, slope: float, inside: Inside, floor: FloorAt, *, fed: bool = True
    ) -> None:
        self._home = grid  # what all grids cover
        self.grid, self.slope, self._inside, self._floor = grid, slope, inside, floor
        self.version, self.came_m3, self.calm = 0, 0.0, False
        far_m = (grid.shape[0] - 1) * ALONG_M - _FED_M if fed else math.inf
        self._behind = (grid.x_m, grid.y_m, grid.heading_rad, far_m)
        self.heights_m: FloatArray = np.maximum(heights_m, 0.0)
        self._around = self._surroundings(grid)
        smooth = gaussian_filter(self.heights_m, (0.3 / ALONG_M, 0.3 / ACROSS_M), mode="nearest")
        stones = np.where(self.heights_m > _SHOWN_M, self.heights_m - smooth, 0.0)
        self.heights_m = np.where(self._around.open_cells, np.maximum(smooth, 0.0), 0.0)
        self.settle()
        self._layers = _Layers(stones, self.heights_m.copy(), self.heights_m.copy())

    @property
    def volume_m3(self) -> float:
        """Volume of the pile, in place."""
        return float(self.heights_m.sum()) * CELL_M2

    def height_at(self, points_m: FloatArray) -> FloatArray:
        """Return the pile's height (...,) over the floor at points (..., 2) of `map`; 0 where it is not."""
        at = np.moveaxis(self.grid.places(points_m), -1, 0)
        height: FloatArray = map_coordinates(self.heights_m, at, order=1, mode="constant")
        return height

    @property
    def stones_m(self) -> FloatArray:
        """Height of stones over the smooth surface, shape (N, M)."""
        return self._layers.stones_m

    def turn_to(self, through_m: FloatArray, heading_rad: float) -> int:
        """Turn the grid to a heading (rad) through a point (x, y); returns the first column on its left. Volume is kept."""
        grid = turned(self._home, through_m, heading_rad)
        at = np.moveaxis(self.grid.places(grid.points()), 2, 0)
        old, volume = self.heights_m, self.volume_m3
        fields = [map_coordinates(one, at, order=1, mode="constant") for one in (old, *self._layers)]
        self.grid = grid
        self._around = self._surroundings(grid)
        self.heights_m = np.where(self._around.open_cells, fields[0], 0.0)
        self.heights_m *= volume / max(self.volume_m3, 1e-9)
        self._layers = _Layers(*fields[1:])
        return round(grid.places(through_m)[1] + 0.5)

    def slice_m(self, first: int, last: int) -> FloatArray:
        """Return the mean heights (N,) of columns, along the heading."""
        return np.ascontiguousarray(self.heights_m[:, first : last + 1].mean(axis=1))

    def give_back(self, first: int, last: int, slice_m: FloatArray) -> None:
        """Take the heights (N,) that the side view made of `slice_m`."""
        change = slice_m - self.slice_m(first, last)
        spread_back(self.heights_m, self._around.open_cells, first, last, change)
        self.version += bool(np.abs(change).max() > _SEEN_M)

    def slide(self, dt_s: float, per_s: float, bucket: tuple[int, int, int, int] = _NO_BUCKET) -> None:
        """Let it slide for a while, at a rate per second, around a bucket (`field.slide_field`)."""
        worst, most = 0.0, max(1, round(dt_s * per_s * _SWEEPS))
        for k in range(most):
            worst = slide_field(self.heights_m, self._around.open_cells, self.slope, 0.8, bucket, down=k % 2 == 0)
            if worst < _STANDS_M:
                break
        self._feed()
        self.calm = worst < _STANDS_M and bucket == _NO_BUCKET
        self.version += worst >= _STANDS_M

    def settle(self) -> None:
        """Let it slide until it stands."""
        for k in range(_MOST_SWEEPS):
            if (
                slide_field(self.heights_m, self._around.open_cells, self.slope, 1.0, _NO_BUCKET, down=k % 2 == 0)
                < _STANDS_M
            ):
                break
        self.calm = True
        self.version += 1

    def mesh(self) -> Mesh:
        """Return its surface in `map`: cells of 0.1 m; where there is no ore it is under the floor."""
        height = self.heights_m
        kept = np.exp(-np.abs(height - self._layers.was_m) / 0.05)  # what was not dug has its stones still
        shown = np.maximum(height + kept * self._layers.stones_m, 0.0)
        z = self._around.floor_m + np.where(self._around.open_cells & (shown > _SHOWN_M), shown, -_BURIED_M)
        points = np.concatenate([self.grid.points(), z[:, :, None]], axis=2)[::_EVERY]
        rows, columns = points.shape[:2]
        faces = sheet(rows, columns)
        ore = (height[::_EVERY] > _SHOWN_M).ravel()[faces].any(axis=1)
        return Mesh(points.reshape(-1, 3), faces[ore] if ore.any() else faces[:1])

    def _surroundings(self, grid: Grid) -> _Around:
        """Return what is around the cells of a grid."""
        points = grid.points()
        inside = self._inside(points)
        x, y, heading, from_m = self._behind
        along = (points - np.array([x, y])) @ np.array([math.cos(heading), math.sin(heading)])
        return _Around(inside, self._floor(points), (along >= from_m) & inside)

    def _feed(self) -> None:
        """Fill the far end up to what it was."""
        missing = np.where(self._around.far_end, np.maximum(self._layers.fed_m - self.heights_m, 0.0), 0.0)
        self.heights_m += missing
        self.came_m3 += float(missing.sum()) * CELL_M2
