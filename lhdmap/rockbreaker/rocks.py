"""Oversize rocks on the grizzly, from a cloud: the plane of the bars, what stands on it, and how large it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from lhdmap.errors import InputError
from lhdmap.geometry.plane import robust_plane
from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.machine import Grizzly

_CELL_M = 0.05
_BORDER_M = 0.3  # a rock may reach over the grizzly's edge by that
_PLANE_M = 0.03  # from a plane's points
_ROUNDS = 3  # of least squares on the points near the plane that chance found
_LEAST_SHARE = 0.1  # of the area that is seen, which a plane must cover
_PLANES = 4  # that are looked for
_STEEPEST = math.tan(math.radians(15.0))
_RISE_M = 0.12  # what stands higher over the bars is rock
_NECK = 0.3  # how much narrower the neck between two rocks must be than the lesser of them
_FEWEST_CELLS = 12
_TALLEST_M = 3.0  # what stands higher over the bars is no rock but a wall or a machine
_TRIALS = 400

Labels = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Rock:
    """A rock on the grizzly: middle of its outline and its top (3,), length, width and height above the bars, metres."""

    top_m: FloatArray
    length_m: float
    width_m: float
    height_m: float

    @property
    def size_m(self) -> float:
        """Its largest dimension."""
        return max(self.length_m, self.height_m)

    @property
    def passing_m(self) -> float:
        """Side of the smallest square opening that it falls through: its middle dimension."""
        return sorted((self.length_m, self.width_m, self.height_m))[1]


@dataclass(frozen=True, slots=True)
class Scene:
    """The grizzly as seen: plane z = c + a x + b y of its bars (c, a, b), and what stands on it, largest first."""

    plane: tuple[float, float, float]
    rocks: tuple[Rock, ...]

    def height_m(self, x_m: float, y_m: float) -> float:
        """Return the height of the bars at a place."""
        return self.plane[0] + self.plane[1] * x_m + self.plane[2] * y_m

    def oversize(self, opening_m: float) -> tuple[Rock, ...]:
        """Return the rocks that do not fall through a square opening, largest first."""
        return tuple(rock for rock in self.rocks if rock.passing_m > opening_m)


def find_rocks(points_m: FloatArray, grizzly: Grizzly) -> Scene:
    """Return the grizzly's plane and the rocks on it from points (N, 3) in the base's frame.

    Raises:
        InputError: the cloud has no points over the grizzly, or no plane of bars among them.
    """
    low, high = np.array(grizzly.min_m) - _BORDER_M, np.array(grizzly.max_m) + _BORDER_M
    inside = (
        np.isfinite(points_m).all(axis=1) & (points_m[:, :2] >= low).all(axis=1) & (points_m[:, :2] <= high).all(axis=1)
    )
    points_m = points_m[inside].astype(np.float64)
    if len(points_m) < 100:
        raise InputError(
            f"{len(points_m)} points of the cloud lie over the grizzly (x {low[0]:g} to {high[0]:g}, y {low[1]:g} to "
            f"{high[1]:g} m from the swing axis): state where the machine stands in the cloud with base.position_m and "
            "base.yaw_deg of --machine"
        )
    plane = _bars(points_m)
    above_m = points_m[:, 2] - plane[0] - points_m[:, :2] @ np.array(plane[1:])
    heights = _height_map(points_m[:, :2], above_m, low, high)
    labels = _parts(heights > _RISE_M)
    rocks = [_rock(labels == k, heights, low, plane) for k in range(1, int(labels.max()) + 1)]
    return Scene(plane, tuple(sorted((one for one in rocks if one is not None), key=lambda one: -one.size_m)))


def _bars(points_m: FloatArray) -> tuple[float, float, float]:
    """Return the highest of the nearly level planes that cover a good part of the grizzly: below the bars the ore pass is seen."""
    left = _thinned(points_m)
    covered = len(np.unique(np.floor(left[:, :2] / _CELL_M), axis=0))
    middle = left[:, :2].mean(axis=0)
    planes: list[FloatArray] = []
    rng = np.random.default_rng(0)
    for _ in range(_PLANES):
        plane = _level_plane(left, rng)
        near = np.abs(_over(left, plane)) < _PLANE_M
        if len(np.unique(np.floor(left[near, :2] / _CELL_M), axis=0)) < _LEAST_SHARE * covered:
            break
        planes.append(plane)
        left = left[np.abs(_over(left, plane)) > 2.0 * _PLANE_M]
        if len(left) < 100:
            break
    if not planes:
        raise InputError("the cloud shows no bars of a grizzly: no level plane among the points over it")
    best = max(planes, key=lambda plane: float(plane[0] + middle @ plane[1:]))
    return float(best[0]), float(best[1]), float(best[2])


def _thinned(points_m: FloatArray) -> FloatArray:
    """Return one point of each small cube, at most 20,000 of them: near the scanner points lie dense."""
    _, first = np.unique(np.floor(points_m / _CELL_M).astype(np.int64), axis=0, return_index=True)
    rows = np.random.default_rng(0).permutation(first)[:20_000]
    return points_m[rows]


def _level_plane(points_m: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return z = c + a x + b y (3,) of the nearly level plane that holds most points, by RANSAC and least squares."""
    best: FloatArray = np.array([math.inf, 0.0, 0.0])
    most = 0
    for _ in range(_TRIALS):
        three = points_m[rng.integers(0, len(points_m), 3)]
        design = np.column_stack([np.ones(3), three[:, :2]])
        if abs(np.linalg.det(design)) < 1e-2:
            continue
        plane: FloatArray = np.linalg.solve(design, three[:, 2]).astype(np.float64)
        if np.hypot(plane[1], plane[2]) > _STEEPEST:
            continue
        count = int(np.count_nonzero(np.abs(_over(points_m, plane)) < _PLANE_M))
        best, most = (plane, count) if count > most else (best, most)
    if not most:
        return best
    near = np.abs(_over(points_m, best)) < _PLANE_M
    return robust_plane(points_m[:, :2], points_m[:, 2], lambda off, _: np.abs(off) < _PLANE_M, _ROUNDS, near).terms


def _over(points_m: FloatArray, plane: FloatArray) -> FloatArray:
    return np.asarray(points_m[:, 2] - plane[0] - points_m[:, :2] @ plane[1:])


def _height_map(xy_m: FloatArray, above_m: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the highest point over the bars in each cell (X, Y), -inf where there is none; holes of one cell are filled."""
    shape = np.ceil((high - low) / _CELL_M).astype(int) + 1
    cells = np.floor((xy_m - low) / _CELL_M).astype(int)
    heights = np.full(tuple(shape), -np.inf)
    np.maximum.at(heights, (cells[:, 0], cells[:, 1]), above_m)
    hole = np.isneginf(heights)
    around = ndimage.median_filter(np.where(hole, 0.0, heights), size=3)
    return np.where(hole & (around > _RISE_M), around, heights)


def _parts(standing: npt.NDArray[np.bool_]) -> Labels:
    """Return a number (X, Y) for each rock: connected cells, cut at a neck that is much narrower than what it joins.

    A watershed on the distance to the outline: from the innermost cells outwards each cell joins its neighbours; where two parts
    meet, they stay two if the lesser one has narrowed by `_NECK` of its own half width until there.
    """
    solid = ndimage.binary_closing(np.pad(standing, 3), structure=np.ones((3, 3)), iterations=1)
    depth = ndimage.distance_transform_edt(solid)
    labels = np.zeros(depth.shape, dtype=np.int32)
    peak, joined = [0.0], [0]
    rows, columns = np.nonzero(depth)
    for k in np.argsort(-depth[rows, columns], kind="stable"):
        i, j = int(rows[k]), int(columns[k])
        around = {_root(joined, int(one)) for one in labels[i - 1 : i + 2, j - 1 : j + 2].flat if one}
        if not around:
            peak.append(float(depth[i, j]))
            joined.append(len(joined))
            around = {len(joined) - 1}
        first, *others = sorted(around, key=lambda one: -peak[one])
        for other in others:
            if depth[i, j] > (1.0 - _NECK) * peak[other]:
                joined[other] = first
        labels[i, j] = first
    roots = np.array([_root(joined, one) for one in range(len(joined))], dtype=np.int32)
    numbers = np.unique(roots, return_inverse=True)[1].astype(np.int32)
    return np.where(standing, numbers[labels[3:-3, 3:-3]], 0).astype(np.int32)


def _root(joined: list[int], one: int) -> int:
    """Return the part that a part was joined to in the end."""
    while joined[one] != one:
        one = joined[one]
    return one


def _rock(
    cells: npt.NDArray[np.bool_], heights: FloatArray, low: FloatArray, plane: tuple[float, float, float]
) -> Rock | None:
    """Return the rock of some cells, or None where they are too few, or too high to be a rock."""
    if np.count_nonzero(cells) < _FEWEST_CELLS:
        return None
    xy_m = low + (np.argwhere(cells) + 0.5) * _CELL_M
    length_m, width_m, middle_m = _outline(xy_m)
    height_m = float(np.percentile(heights[cells], 98))
    if height_m > _TALLEST_M:
        return None
    z_m = plane[0] + float(middle_m @ np.array(plane[1:])) + height_m
    return Rock(np.array([*middle_m, z_m]), length_m, width_m, height_m)


def _outline(xy_m: FloatArray) -> tuple[float, float, FloatArray]:
    """Return length, width and middle (2,) of the narrowest rectangle around cells (N, 2)."""
    angles = np.radians(np.arange(0.0, 90.0, 3.0))
    axes = np.stack([np.cos(angles), np.sin(angles)])
    along, across = xy_m @ axes, xy_m @ np.stack([-axes[1], axes[0]])
    sides = np.stack([np.ptp(along, axis=0), np.ptp(across, axis=0)]) + _CELL_M
    k = int(np.argmin(sides.prod(axis=0)))
    at = 0.5 * np.array([along[:, k].min() + along[:, k].max(), across[:, k].min() + across[:, k].max()])
    middle = np.array([axes[0, k] * at[0] - axes[1, k] * at[1], axes[1, k] * at[0] + axes[0, k] * at[1]])
    return float(sides[:, k].max()), float(sides[:, k].min()), middle
