"""A drive fitted to a map scan by scan: each view that meets the map's walls ties the drive to it; the map itself stays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter
from scipy.spatial import KDTree

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.information import marginal_information
from lhdmap.scan_matching.matching import Hits
from lhdmap.scan_matching.scan_points import flattened
from lhdmap.scan_matching.search import SearchGrid
from lhdmap.scan_matching.submap import Submap, unsure
from lhdmap.smoothing.robust import Tie, judged
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Correction
from lhdmap.topology.views import View

_KEY_M = 2.0
_MOST_TRIED = 24
_AROUND_M, _FEWEST_VIEWS = 12.0, 6
_WITHIN_M, _LEVEL_M = 2.5, 4.0
_CELL_M, _WINDOW_CELLS = 0.04, 512
_GRID = SearchGrid(0.15, math.radians(2.5), apart_m=math.inf)
_FIRST_REACH, _REACH = np.array([2.5, math.radians(6.0)]), np.array([1.0, math.radians(4.0)])
_UNKNOWN = np.diag([5.0**2, 5.0**2, math.radians(15.0) ** 2])  # of the first pose, before anything was matched
_SMOOTHED_KEYS = 7


class Seen(NamedTuple):
    """A drive that was mapped: views and their poses (N, 4: x, y, z, heading)."""

    views: Sequence[View]
    poses: FloatArray


class Fit(NamedTuple):
    """How a drive is to be moved into the map; how many keys it has, and how many of them the map's walls hold.

    `within`: how many lie where the map's own drive went.
    """

    correction: Correction
    keys: int
    tied: int
    within: int = 0


def fitted(known: Seen, drive: Seen, pose_map_drive: FloatArray, settings: SmoothingSettings) -> Fit | None:
    """Return how a drive, about at `pose_map_drive` (3,), fits into a map; None where too little of it does."""
    keys = _keys(drive.poses)
    planar = drive.poses[:, [0, 1, 3]]
    tree = KDTree(known.poses[:, :2])
    moved = pose_map_drive
    ties: list[Tie] = []
    raised: list[tuple[int, float]] = []
    within = 0
    for number, row in enumerate(keys, 1):
        predicted = se2.compose(moved, planar[row])
        near = np.array(tree.query_ball_point(predicted[:2], _AROUND_M), dtype=np.int64)
        if raised:  # before the first tie the map's height over the drive's is not known
            near = near[np.abs(known.poses[near, 2] - drive.poses[row, 2] - raised[-1][1]) < _LEVEL_M]
        if len(near) < _FEWEST_VIEWS:
            continue
        within += bool(np.linalg.norm(known.poses[near, :2] - predicted[:2], axis=1).min() < _WITHIN_M)
        tie = _tie(known, near, drive.views[row], predicted, _REACH if ties else _FIRST_REACH, settings)
        if tie is None:
            continue
        ties.append(tie._replace(second=number))
        moved = se2.compose(tie.pose_first_second, se2.inverse(planar[row]))
        nearest = near[np.linalg.norm(known.poses[near, :2] - tie.pose_first_second[:2], axis=1).argmin()]
        raised.append((row, float(known.poses[nearest, 2] - drive.poses[row, 2])))
    if len(ties) < 2:
        return None
    solved = _solved(drive, keys, planar, pose_map_drive, ties, raised, settings)
    return None if solved is None else solved._replace(within=within)


def share_that_fits(known: Seen, drive: Seen, pose_map_drive: FloatArray, settings: SmoothingSettings) -> float:
    """Return which share of a drive's keys, some tried, the map's walls hold where the drive is at `pose_map_drive` (3,)."""
    keys = _keys(drive.poses)
    tried = keys[:: max(len(keys) // _MOST_TRIED, 1)]
    tree = KDTree(known.poses[:, :2])
    held = 0
    for row in tried:
        predicted = se2.compose(pose_map_drive, drive.poses[row, [0, 1, 3]])
        near = np.array(tree.query_ball_point(predicted[:2], _AROUND_M), dtype=np.int64)
        if len(near) >= _FEWEST_VIEWS:
            held += _tie(known, near, drive.views[row], predicted, _FIRST_REACH, settings) is not None
    return held / max(len(tried), 1)


def _keys(poses: FloatArray) -> npt.NDArray[np.int64]:
    """Return the rows of poses each two metres."""
    steps = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    rows: npt.NDArray[np.int64] = np.unique((travelled / _KEY_M).astype(np.int64), return_index=True)[1]
    return rows


def _tie(
    known: Seen,
    near: npt.NDArray[np.int64],
    view: View,
    predicted: FloatArray,
    reach: FloatArray,
    settings: SmoothingSettings,
) -> Tie | None:
    """Return where a view is by the map's views around it, None where it fits nowhere or the walls do not tell."""
    centre = known.poses[near[len(near) // 2], [0, 1, 3]] * [1.0, 1.0, 0.0]
    submap = Submap(_CELL_M, grid=_GRID, window_cells=_WINDOW_CELLS)
    for row in near:
        submap.insert(flattened(known.views[row].hits_m), se2.between(centre, known.poses[row, [0, 1, 3]]))
    hits = flattened(view.hits_m)
    start = se2.between(centre, predicted)
    found = next(iter(submap.locate(Hits(hits, len(hits), layered=False), unsure(start), reach)), None)
    if found is None or found.support < settings.min_support:
        return None
    sigma = 1.0 / np.sqrt(np.maximum(marginal_information(found.information), 1e-12))
    if sigma[:2].max() > settings.max_sigma_m:
        return None
    covariance = np.linalg.inv(found.information) + np.diag([0.02**2, 0.02**2, math.radians(0.1) ** 2])
    pose = se2.compose(centre, found.pose)
    # A tie leads from the map's frame: its covariance is about the map's axes there already.
    return Tie(0, 0, pose, np.asarray(covariance, dtype=float))


def _solved(
    drive: Seen,
    keys: npt.NDArray[np.int64],
    planar: FloatArray,
    pose_map_drive: FloatArray,
    ties: list[Tie],
    raised: list[tuple[int, float]],
    settings: SmoothingSettings,
) -> Fit | None:
    """Return the drive moved so that the ties that agree hold; the first pose of the graph is the map's origin."""
    at = np.array([se2.compose(pose_map_drive, planar[row]) for row in keys])
    graph = np.vstack([np.zeros((1, 3)), at])
    steps = [_UNKNOWN, *(_step(planar[a], planar[b], settings) for a, b in pairwise(keys))]
    judgement = judged(graph, steps, ties)
    if judgement.kept.sum() < 2:
        return None
    kept = [tie for tie, keep in zip(ties, judgement.kept, strict=True) if keep]
    moves = np.array([se2.compose(tie.pose_first_second, se2.inverse(planar[keys[tie.second - 1]])) for tie in kept])
    moves[:, 2] = np.unwrap(moves[:, 2])
    times = np.array([drive.views[keys[tie.second - 1]].time_ns for tie in kept], dtype=np.int64)
    rises = np.array([rise for (_, rise), keep in zip(raised, judgement.kept, strict=True) if keep])
    smooth = median_filter(rises, size=min(_SMOOTHED_KEYS, len(rises)), mode="nearest")
    return Fit(Correction(times, moves, len(kept), None, smooth), len(keys), len(kept))


def _step(before: FloatArray, after: FloatArray, settings: SmoothingSettings) -> FloatArray:
    """Return the covariance (3, 3) of a step of the drive's own map."""
    way = max(math.hypot(after[0] - before[0], after[1] - before[1]), 0.1)
    position = 3.0 * settings.along_sigma * math.sqrt(way)
    heading = 3.0 * math.radians(settings.heading_sigma_deg) * math.sqrt(way)
    return np.diag([position**2, position**2, heading**2])
