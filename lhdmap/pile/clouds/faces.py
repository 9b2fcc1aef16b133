"""Faces of a heap: stretches of its height map that look one way, found by region growing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.clouds.height_map import HeightMap, Mask

_MOST_APART_DEG = 15.0
_FLATTEST_DEG = 10.0
_LEAST_SHARE = 0.05


class HeapFace(NamedTuple):
    """A face: which cells (I, J), slope (deg, positive) with its standard deviation, downhill direction (rad), true area (m²)."""

    cells: Mask
    slope_deg: float
    slope_std_deg: float
    downhill_rad: float
    area_m2: float


def find_faces(surface: HeightMap, usable: Mask) -> list[HeapFace]:
    """Return the faces among the usable cells (I, J), the largest first; those under 5 % of the surface are left out.

    A face grows from the cell whose surroundings agree best, over neighbours whose normal is within 15 deg of the mean of
    those taken so far. Its slope is the median of its cells' (a cone's sector has the cone's slope, its plane has not).
    """
    usable = usable & np.isfinite(surface.gradient).all(axis=-1)
    normals = _normals(surface)
    free = usable & (surface.slope_deg >= _FLATTEST_DEG)
    smallest = max(_LEAST_SHARE * np.count_nonzero(usable), 4.0)
    faces = []
    for i, j in _seeds(surface, free):
        if not free[i, j]:
            continue
        cells = _grown(normals, free, (i, j))
        free &= ~cells
        if np.count_nonzero(cells) >= smallest:
            faces.append(_face(surface, cells))
    return sorted(faces, key=lambda face: -face.area_m2)


def _normals(surface: HeightMap) -> FloatArray:
    """Return the unit normals of all cells, shape (I, J, 3), upwards."""
    gradient = np.nan_to_num(surface.gradient)
    normals = np.concatenate([-gradient, np.ones((*gradient.shape[:2], 1))], axis=-1)
    unit: FloatArray = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return unit


def _seeds(surface: HeightMap, free: Mask) -> list[tuple[int, int]]:
    """Return the free cells, the smoothest first."""
    rows, columns = np.nonzero(free)
    order = np.argsort(surface.roughness_m[rows, columns], kind="stable")
    return list(zip(rows[order].tolist(), columns[order].tolist(), strict=True))


def _grown(normals: FloatArray, free: Mask, seed: tuple[int, int]) -> Mask:
    """Return the cells (I, J) that can be reached from the seed without leaving 15 deg about the mean normal."""
    taken = np.zeros_like(free)
    taken[seed] = True
    border, total = [seed], normals[seed].copy()
    limit = math.cos(math.radians(_MOST_APART_DEG))
    while border:
        i, j = border.pop(0)
        for place in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
            inside = 0 <= place[0] < free.shape[0] and 0 <= place[1] < free.shape[1]
            if not inside or not free[place] or taken[place]:
                continue
            if float(normals[place] @ total) >= limit * float(np.linalg.norm(total)):
                taken[place] = True
                total += normals[place]
                border.append(place)
    return taken


def _face(surface: HeightMap, cells: Mask) -> HeapFace:
    slopes = surface.slope_deg[cells]
    downhill = _normals(surface)[cells].sum(axis=0)
    count = len(slopes)
    # Cells within a radius of each other share their points: that many are independent.
    independent = max(count * (surface.cell_m / surface.radius_m) ** 2 / math.pi, 1.0)
    spread = 1.4826 * float(np.median(np.abs(slopes - np.median(slopes))))
    area = float((surface.cell_m**2 / np.cos(np.radians(slopes))).sum())
    return HeapFace(
        cells,
        float(np.median(slopes)),
        1.2533 * spread / math.sqrt(independent),  # standard error of a median
        math.atan2(downhill[1], downhill[0]),
        area,
    )
