"""Free space near the drive: fans of scans drawn into a grid, walls where hits gather, small obstacles filled.

A beam says that all up to its hit is free; between neighbouring beams whose hits are near in angle the room is free, too. Where a
stretch of beams saw nothing (a long tunnel) nothing is said. What stands in the way is filled when its bounding box is small: a
parked car is no pillar.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet
from lhdmap.topology.views import Fan

_SHIFT = 4  # bits of a fraction of a cell that polygons are drawn with
_GAP_STEPS, _GAP_M = 2.2, 0.5  # hits so many beams apart, and so far in space, have unseen room between them
_WALL_SHARE = 0.25  # hits in a cell for each time that it was seen to be free, from which on it is wall
_FEWEST_SEEN, _FANS_EACH = 3, 20  # of many fans so many have to see a cell: a single one looks through a crack
_PULLED_CELLS = 0.7  # a beam is free up to so many cells before its hit


def free_space(
    fans: Sequence[Fan],
    poses: FloatArray,
    of_fan: npt.NDArray[np.int64],
    cell_m: float,
    settings: TopologySettings,
    weights: npt.NDArray[np.int64] | None = None,
) -> Sheet:
    """Return the grid of fans seen from poses (N, 4: x, y, z, heading) of the machine; `of_fan` (M,) is each fan's pose.

    `weights` (N,): how often a pose's fans count; what was seen later tells more of what is there now.
    """
    reach = settings.reach_m
    low = poses[:, :2].min(axis=0) - reach - 2.0
    size = np.ceil((poses[:, :2].max(axis=0) + reach + 2.0 - low) / cell_m).astype(int)
    free, walls = np.zeros((size[1], size[0]), np.uint16), np.zeros((size[1], size[0]), np.uint16)
    for fan, row in zip(fans, of_fan, strict=True):
        _draw(fan, poses[row], (low, cell_m, reach), 1 if weights is None else int(weights[row]), free, walls)
    cells = np.full(free.shape, UNKNOWN, np.uint8)
    cells[free >= min(_FEWEST_SEEN, max(len(fans) // _FANS_EACH, 1))] = FREE
    cells[walls > np.maximum(_WALL_SHARE * free, 0.0)] = OCCUPIED
    heights = poses[:, 2]
    span = float(heights.min()), float(heights.max())
    return Sheet(cells, low, cell_m, float(np.median(heights)), span)


def _draw(
    fan: Fan,
    pose: FloatArray,
    grid: tuple[FloatArray, float, float],
    weight: int,
    free: npt.NDArray[np.uint16],
    walls: npt.NDArray[np.uint16],
) -> None:
    """Count a fan's free cells and its hits; `grid`: corner (2,), size of a cell, how far is looked (m)."""
    low_m, cell_m, reach_m = grid
    c, s = math.cos(pose[3]), math.sin(pose[3])
    R = np.array([[c, -s], [s, c]])
    beams = fan.hits_m[:, :2].astype(float) - fan.origin_m
    ranges = np.hypot(beams[:, 0], beams[:, 1])
    keep = ranges > cell_m
    beams, ranges = beams[keep], ranges[keep]
    if len(beams) < 2:
        return
    origin = R @ fan.origin_m + pose[:2]
    corner = np.floor((origin - reach_m - low_m) / cell_m).astype(int) - 1  # of the patch that is drawn into
    size = int(2.0 * reach_m / cell_m) + 4
    share = np.minimum(ranges - _PULLED_CELLS * cell_m, reach_m) / ranges
    ends = (origin + (beams * share[:, None]) @ R.T - low_m) / cell_m - corner
    middle = (origin - low_m) / cell_m - corner
    patch = np.zeros((size, size), np.uint8)
    for part in _parts(beams):
        ring = np.vstack([middle, ends[part]]) - 0.5
        cv2.fillPoly(patch, [np.round(ring * (1 << _SHIFT)).astype(np.int32)], weight, shift=_SHIFT)
    rows, columns = slice(corner[1], corner[1] + size), slice(corner[0], corner[0] + size)
    _add(free, patch, rows, columns)
    near = ranges < reach_m
    hits = np.floor((origin + beams[near] @ R.T - low_m) / cell_m).astype(int)
    inside = ((hits >= 0) & (hits < [walls.shape[1], walls.shape[0]])).all(axis=1)
    walls.reshape(-1)[np.unique(hits[inside, 1] * walls.shape[1] + hits[inside, 0])] += weight


def _add(counts: npt.NDArray[np.uint16], patch: npt.NDArray[np.uint8], rows: slice, columns: slice) -> None:
    """Add a patch where it lies within the grid."""
    top, left = max(rows.start, 0), max(columns.start, 0)
    bottom, right = min(rows.stop, counts.shape[0]), min(columns.stop, counts.shape[1])
    counts[top:bottom, left:right] += patch[
        top - rows.start : bottom - rows.start, left - columns.start : right - columns.start
    ]


def _parts(beams: FloatArray) -> list[slice]:
    """Return the stretches of a fan without gaps, each of two beams or more."""
    angles = np.unwrap(np.arctan2(beams[:, 1], beams[:, 0]))
    step = np.abs(np.diff(angles))
    apart = np.linalg.norm(np.diff(beams, axis=0), axis=1)
    gaps = np.flatnonzero((step > _GAP_STEPS * np.percentile(step, 10)) & (apart > _GAP_M)) + 1
    bounds = [0, *gaps.tolist(), len(beams)]
    return [slice(a, b) for a, b in pairwise(bounds) if b - a > 1]


def filled(cells: npt.NDArray[np.uint8], cell_m: float, diagonal_m: float) -> npt.NDArray[np.bool_]:
    """Return the free cells, islands within them filled whose bounding box has a diagonal below `diagonal_m`."""
    free = cells == FREE
    count, labels, boxes, _ = cv2.connectedComponentsWithStats((~free).astype(np.uint8), connectivity=8)
    for label in range(1, count):
        left, top, width, height, _ = boxes[label]
        inside = left > 0 and top > 0 and left + width < free.shape[1] and top + height < free.shape[0]
        if inside and math.hypot(width, height) * cell_m < diagonal_m:
            patch = labels[top : top + height, left : left + width] == label
            free[top : top + height, left : left + width] |= patch
    return free
