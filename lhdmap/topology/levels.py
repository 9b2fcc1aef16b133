"""Levels above each other: heights at which a drive is cut into sheets, so that no sheet has two drifts over one another.

One grid would join drifts that cross at different heights. Where two places of the drive are nearer than a tunnel's width in plan
and farther than a level's gap in height, a boundary has to lie between them; of all heights that do it the one is taken that the
drive passes quickest, which is a ramp and no level. A tunnel is cut where it passes the boundary, and joined there afterwards.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d, median_filter
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray

_NEAR_M = 6.0  # in plan: half widths of two drifts
_STEP_M = 0.25
_QUIET_M = 1.0  # heights around a boundary in which the way counts
_AGAIN_M = 10.0  # passages nearer than this are of one tunnel
_MARGIN = 0.15  # of the gap, kept from both drifts


class Cut(NamedTuple):
    """Where a drive passes from one sheet to the next: pose (4,: x, y, z, heading) and the lower sheet's number."""

    pose: FloatArray
    lower: int


def boundaries_m(poses: FloatArray, gap_m: float) -> list[float]:
    """Return the heights, rising, that separate the levels of a drive at poses (N, 4: x, y, z, heading); none if it has one."""
    intervals = _conflicts(poses, gap_m)
    if not len(intervals):
        return []
    heights = np.arange(poses[:, 2].min(), poses[:, 2].max() + _STEP_M, _STEP_M)
    way = np.array([np.count_nonzero(np.abs(poses[:, 2] - height) < _QUIET_M) for height in heights])
    found: list[float] = []
    for low, high in intervals[np.argsort(intervals[:, 1])]:
        if any(low <= height <= high for height in found):
            continue
        margin = _MARGIN * (high - low)
        inside = np.flatnonzero((heights >= low + margin) & (heights <= high - margin))
        if len(inside):
            middle = 0.5 * (low + high)
            best = min(inside, key=lambda k: (int(way[k]), abs(float(heights[k]) - middle)))
            found.append(float(heights[best]))
    return sorted(found)


def _conflicts(poses: FloatArray, gap_m: float) -> FloatArray:
    """Return pairs of heights (K, 2), lower and upper, of places above each other."""
    thin = poses[:: max(len(poses) // 4000, 1)]
    pairs = KDTree(thin[:, :2]).query_pairs(_NEAR_M, output_type="ndarray")
    heights = np.sort(thin[pairs][:, :, 2], axis=1) if len(pairs) else np.zeros((0, 2))
    apart = heights[heights[:, 1] - heights[:, 0] > gap_m]
    return np.unique(np.round(apart, 1), axis=0)


def sheets_of(poses: FloatArray, boundaries: list[float]) -> npt.NDArray[np.int64]:
    """Return the sheet (N,) of each pose of a drive (N, 4), the lowest is 0; heights are smoothed over some metres before."""
    if not boundaries:
        return np.zeros(len(poses), dtype=np.int64)
    smooth = gaussian_filter1d(poses[:, 2], 5.0, mode="nearest")
    sheets = np.searchsorted(boundaries, smooth).astype(np.int64)
    settled: npt.NDArray[np.int64] = median_filter(sheets, size=9, mode="nearest")
    return settled


def cuts_of(poses: FloatArray, sheets: npt.NDArray[np.int64]) -> list[Cut]:
    """Return where the drive passes from sheet to sheet, each tunnel once."""
    found: list[Cut] = []
    for row in np.flatnonzero(np.diff(sheets)):
        pose = 0.5 * (poses[row] + poses[row + 1])
        pose[3] = poses[row, 3]
        lower = int(min(sheets[row], sheets[row + 1]))
        near = [cut for cut in found if cut.lower == lower and math.dist(cut.pose[:3], pose[:3]) < _AGAIN_M]
        if not near:
            found.append(Cut(pose, lower))
    return found
