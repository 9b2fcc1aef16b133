"""The face as a relief: what stands out of the fitted surface, cell by cell, and what lies in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from lhdmap.messages import FloatArray
from lhdmap.pile.result import Boulder
from lhdmap.pile.surface import Scene

CELL_M = 0.1
_PROUD_M = 0.28  # findings: a boulder protrudes by more, over more than _PATCH_M2
_PATCH_M2 = 0.25
_SMALLEST_M = 0.8  # smaller rocks go into the bucket


class Relief(NamedTuple):
    """Cells (rows: height, columns: y): by how much the rock stands out along the normal (m, NaN: not seen).

    `y_m`, `z_m`: middles of columns and rows, end frame.
    """

    proud_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray


def relief(scene: Scene) -> Relief:
    """Return the relief of all that was seen near the face between the walls."""
    points, face, limits = scene.points, scene.face, scene.limits
    off = face.x_at(points[:, 1], points[:, 2]) - points[:, 0]
    proud = off / math.sqrt(1.0 + face.b**2 + face.c**2)
    height = points[:, 2] - scene.floor_m
    near = (proud > -0.8) & (proud < 1.6) & (height > 0.05) & (height < 3.0)
    near &= (points[:, 1] < limits.left_m - 0.12) & (points[:, 1] > limits.right_m + 0.12)
    columns = max(int((limits.left_m - limits.right_m) / CELL_M), 1)
    rows = int(3.0 / CELL_M)
    iy = np.clip(((points[near, 1] - limits.right_m) / CELL_M).astype(np.int64), 0, columns - 1)
    iz = np.clip((height[near] / CELL_M).astype(np.int64), 0, rows - 1)
    flat = iz * columns + iy
    total = np.bincount(flat, proud[near], rows * columns)
    count = np.bincount(flat, minlength=rows * columns)
    with np.errstate(invalid="ignore"):
        mean = np.where(count > 0, total / np.maximum(count, 1), math.nan).reshape(rows, columns)
    y: FloatArray = limits.right_m + (np.arange(columns, dtype=np.float64) + 0.5) * CELL_M
    z: FloatArray = scene.floor_m + (np.arange(rows, dtype=np.float64) + 0.5) * CELL_M
    return Relief(mean, y, z)


def boulders(scene: Scene, seen: Relief) -> tuple[Boulder, ...]:
    """Return the connected patches that stand out of the face by more than rubble does."""
    proud = np.nan_to_num(seen.proud_m, nan=-1.0) > _PROUD_M
    standing = np.nan_to_num(seen.proud_m, nan=-1.0) > 0.5 * _PROUD_M
    joined = ndimage.binary_closing(proud, np.ones((3, 3)))
    labels, count = ndimage.label(joined, np.ones((3, 3)))
    found = []
    for index in range(1, count + 1):
        patch = labels == index
        cells = patch & proud
        rows, columns = np.nonzero(cells)
        slant = math.sqrt(1.0 + scene.face.c**2)
        if cells.sum() * CELL_M**2 * slant < _PATCH_M2:
            continue
        y, z = seen.y_m[columns], seen.z_m[rows]
        # its size is that of all that stands out about it: what is proud by more is only its top
        foot_rows, foot_columns = np.nonzero(ndimage.binary_dilation(cells, iterations=2) & standing)
        extent = max(float(np.ptp(foot_rows)), float(np.ptp(foot_columns))) * CELL_M + CELL_M
        if extent < _SMALLEST_M:
            continue
        fronts = scene.face.x_at(y, z) - seen.proud_m[rows, columns] * slant
        middle_y, middle_z = 0.5 * float(y.min() + y.max()), 0.5 * float(z.min() + z.max())
        x = float(np.percentile(fronts, 10.0)) + 0.5 * extent  # its middle lies behind its front by half its size
        found.append(Boulder(scene.frame.map(np.array([x, middle_y, middle_z])), extent))
    return tuple(found)
