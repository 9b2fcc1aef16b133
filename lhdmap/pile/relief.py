"""The face as a relief: what stands out of the fitted surface, cell by cell, and what lies in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from lhdmap.messages import FloatArray
from lhdmap.pile.result import Boulder
from lhdmap.pile.surface import Mask, PileScene

CELL_M = 0.1
PROUD_M = 0.28  # findings: a boulder protrudes by more, over more than _PATCH_M2
_PATCH_M2 = 0.2
_SMALLEST_M = 0.8  # smaller rocks go into the bucket
_LARGEST = 0.5  # what stands out over more than this share of the drift's width is the face's own shape
_ALONG_M = 0.15  # deviation of the depths in a cell of which the drift's own surface has more, a rock's front less
_MIXED_M = 0.5  # the same of a cell that is left out: it holds a rock's edge and, farther back, the face
_CUT = 1.15  # the ball's radius in that of what stands out by half as much as a boulder must
_FEWEST_STEPS = 20
_BY_WALL_M = 0.4  # what reaches less far from the wall is less than half the smallest boulder: the wall's own roughness


class Relief(NamedTuple):
    """Cells (rows: height, columns: y): by how much the rock stands out along the normal (m, NaN: not seen).

    `depth_std_m`: standard deviation of x of the hits in each cell (NaN: fewer than two); large where one looks along a
    surface. `y_m`, `z_m`: middles of columns and rows, end frame.
    """

    proud_m: FloatArray
    depth_std_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray


def relief(scene: PileScene) -> Relief:
    """Return the relief of all that was seen near the face between the walls."""
    points, face, limits = scene.points, scene.face, scene.limits
    off = face.x_at(points[:, 1], points[:, 2]) - points[:, 0]
    proud = off / math.sqrt(1.0 + face.b**2 + face.c**2)
    height = points[:, 2] - scene.floor_m
    near = (proud > -0.8) & (proud < 1.6) & (height > 0.05) & (height < 3.0)
    near &= (points[:, 1] < limits.left_m - 0.12) & (points[:, 1] > limits.right_m + 0.12)
    rows, columns = shape = _shape(scene)
    flat = _cells(scene, points[near])
    mean, _ = _moments(flat, proud[near], shape)
    _, depth_std = _moments(flat, points[near, 0], shape)
    y: FloatArray = limits.right_m + (np.arange(columns, dtype=np.float64) + 0.5) * CELL_M
    z: FloatArray = scene.floor_m + (np.arange(rows, dtype=np.float64) + 0.5) * CELL_M
    return Relief(mean, depth_std, y, z)


def _shape(scene: PileScene) -> tuple[int, int]:
    return int(3.0 / CELL_M), max(int((scene.limits.left_m - scene.limits.right_m) / CELL_M), 1)


def _cells(scene: PileScene, points: FloatArray) -> npt.NDArray[np.int64]:
    """Return the number of the relief's cell of each point (N, 4)."""
    rows, columns = _shape(scene)
    iy = np.clip(((points[:, 1] - scene.limits.right_m) / CELL_M).astype(np.int64), 0, columns - 1)
    iz = np.clip(((points[:, 2] - scene.floor_m) / CELL_M).astype(np.int64), 0, rows - 1)
    return iz * columns + iy


def hits_on(scene: PileScene, seen: Relief, rocks: Sequence[Patch]) -> Mask:
    """Return which hits of the scene (N,) lie in the cells of rocks."""
    cells = np.zeros(seen.proud_m.shape, np.bool_)
    for rock in rocks:
        cells |= rock.cells | rock.foot
    return cells.ravel()[_cells(scene, scene.points)]


def grain_m(seen: Relief, low_m: float, high_m: float) -> float:
    """Return how much cells beside each other differ between two heights: rubble has edges, blasted rock has waves; 0: unknown."""
    rows = seen.proud_m[(seen.z_m > low_m) & (seen.z_m < high_m)]
    steps = np.abs(np.diff(rows, axis=1))
    steps = steps[np.isfinite(steps)]
    return 1.4826 * float(np.median(steps)) / math.sqrt(2.0) if steps.size >= _FEWEST_STEPS else 0.0


def _moments(flat: npt.NDArray[np.int64], values: FloatArray, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of the values in each cell; NaN where there are none, or fewer than two."""
    size = shape[0] * shape[1]
    count = np.bincount(flat, minlength=size)
    mean = np.bincount(flat, values, size) / np.maximum(count, 1)
    variance = np.bincount(flat, (values - mean[flat]) ** 2, size) / np.maximum(count - 1, 1)
    std = np.where(count > 1, np.sqrt(variance), math.nan)
    return np.where(count > 0, mean, math.nan).reshape(shape), std.reshape(shape)


class Patch(NamedTuple):
    """A rock in the relief: its cells, and all that stands out about it (masks)."""

    cells: Mask
    foot: Mask


def patches(scene: PileScene, seen: Relief, proud_m: float = PROUD_M) -> list[Patch]:
    """Return the connected patches that stand out of the face by more than rubble does.

    Walls, floor and roof stand out of the face, too, where they meet it. One looks along them: hits of many depths share a
    cell, while the front of a rock has one.
    """
    across = np.nan_to_num(seen.depth_std_m, nan=0.0) < _MIXED_M
    proud = (np.nan_to_num(seen.proud_m, nan=-1.0) > proud_m) & across
    standing = (np.nan_to_num(seen.proud_m, nan=-1.0) > 0.5 * proud_m) & across
    labels, count = ndimage.label(ndimage.binary_closing(proud, np.ones((3, 3))), np.ones((3, 3)))
    found = [_patch((labels == index) & proud, standing) for index in range(1, count + 1)]
    return [one for one in found if _is_rock(scene, seen, one)]


def boulders(scene: PileScene, seen: Relief) -> tuple[Boulder, ...]:
    """Return the rocks that stand out of the face."""
    return tuple(_boulder(scene, seen, one) for one in patches(scene, seen))


def _patch(cells: Mask, standing: Mask) -> Patch:
    # what is proud by more is only a rock's top: its size is that of all that stands out about it
    return Patch(cells, ndimage.binary_dilation(cells, iterations=2) & standing)


def _is_rock(scene: PileScene, seen: Relief, patch: Patch) -> bool:
    """Return whether a patch is neither too small nor the drift's own surface."""
    limits = scene.limits
    if patch.cells.sum() * CELL_M**2 * math.hypot(1.0, scene.face.c) < _PATCH_M2:
        return False
    y, depths = seen.y_m[np.nonzero(patch.cells)[1]], seen.depth_std_m[patch.cells]
    along = bool(np.isfinite(depths).any()) and float(np.nanmedian(depths)) > _ALONG_M
    if along or min(limits.left_m - float(y.min()), float(y.max()) - limits.right_m) < _BY_WALL_M:
        return False
    rows, columns = np.nonzero(patch.foot)
    extent = max(float(np.ptp(rows)), float(np.ptp(columns))) * CELL_M + CELL_M
    return _SMALLEST_M <= extent <= _LARGEST * (limits.left_m - limits.right_m)


def _boulder(scene: PileScene, seen: Relief, patch: Patch) -> Boulder:
    """Return the ball that fills a patch, about half of it in the face.

    Looked at from the front, one sees a half disc above its middle, and below it what the face, rising from under it, leaves of
    the other half: an ellipse as much lower as the face leans. Area and mean height of the two give its radius and middle.
    """
    face = scene.face
    slant = math.hypot(1.0, face.c)
    radius = _CUT * math.sqrt(2.0 * patch.foot.sum() * CELL_M**2 / (math.pi * (1.0 + 1.0 / slant)))
    rows, columns = np.nonzero(patch.foot)
    y = float(seen.y_m[columns].mean())
    z = float(seen.z_m[rows].mean()) - 4.0 / (3.0 * math.pi) * radius * (1.0 - 1.0 / slant)
    out = float(np.percentile(seen.proud_m[patch.cells], 95.0)) - radius
    x = float(face.x_at(np.array([y]), np.array([z]))[0]) - out * slant
    return Boulder(scene.frame.map(np.array([x, y, z])), 2.0 * radius)
