"""Where a drive runs through what another one has mapped: the global search of localization, window by window, then scan by scan.

Each window of the drive proposes places. Places that say the same of where the drive lies are one; the drive is fitted at the
likeliest ones. It overlaps where the map's walls hold most of its scans that lie in the map, over some metres, and holds them at
no second place as well.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.localization.recent_way import RecentWay
from lhdmap.localization.search import FIND, GlobalSearch, Question
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.topology.views import View
from lhdmap.update import fit

_WINDOW_M, _EVERY_M = 24.0, 12.0
_LEVEL_M, _RANGE_M = 2.5, 12.0  # hits of walls, near the machine
_LEAST_PROBABILITY, _TRIED = 0.05, 8
_SAME_M, _SAME_RAD, _DRIFT = 2.0, math.radians(5.0), 0.01
_FEWEST_TIED, _SHARE_TIED = 5, 0.5
_AS_WELL = 0.5  # of the scans that fit at the best place: with so many a second place is as good
NOWHERE, ALIKE = "their walls meet nowhere", "two places fit"


class Overlap(NamedTuple):
    """How the drive fits into the map, or `reason` why nothing is said."""

    found: fit.Fit | None
    reason: str = ""


class _Place(NamedTuple):
    """A place that a window proposes: `pose_map_drive` (3,), the machine's pose (3,) in the drive's frame there.

    `weight`: its probability, over the reduced χ² of its walls.
    """

    pose_map_drive: FloatArray
    pose: FloatArray
    weight: float


def overlap_of(known: KnownMap, seen: fit.Seen, drive: fit.Seen, settings: Settings) -> Overlap:
    """Return where a drive lies in a map whose own drive has `seen` it."""
    search = known.search(MapWalls(known.topology, known.landmarks), settings)
    groups = _groups(_proposed(search, drive, settings))
    fits = [fit.fitted(seen, drive, group[0].pose_map_drive, settings.smoothing) for group in groups[:_TRIED]]
    held = sorted((one for one in fits if one is not None and _holds(one)), key=lambda one: -one.tied)
    apart = [one for one in held[1:] if _differ(one, held[0], drive)]
    if not held:
        return Overlap(None, NOWHERE)
    if apart and apart[0].tied >= _AS_WELL * held[0].tied:
        return Overlap(None, ALIKE)
    return Overlap(held[0])


def _proposed(search: GlobalSearch, drive: fit.Seen, settings: Settings) -> list[_Place]:
    """Return what each window of the drive proposes."""
    found, way, searched_m = list[_Place](), RecentWay(_WINDOW_M, settings.landmarks), 0.0
    poses = drive.poses[:, [0, 1, 3]]
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    for view, pose, at_m in zip(drive.views, poses, travelled.tolist(), strict=True):
        way.add(pose, _near(view))
        if at_m - searched_m < _EVERY_M or way.length_m < settings.localization.search_m:
            continue
        searched_m = at_m
        said = search.answer(Question(view.time_ns, at_m, FIND, way.snapshot(), pose, None))
        found += [
            _Place(se2.compose(one.pose, se2.inverse(pose)), pose, one.probability / max(one.chi2, 1.0))
            for one in said.candidates
            if one.probability >= _LEAST_PROBABILITY
        ]
    return found


def _near(view: View) -> FloatArray:
    hits = view.hits_m
    near: FloatArray = hits[(hits[:, 2] < _LEVEL_M) & (np.hypot(hits[:, 0], hits[:, 1]) < _RANGE_M), :2]
    return near


def _groups(places: list[_Place]) -> list[list[_Place]]:
    """Return the places that agree on where the drive lies, the likeliest group first, its best place in front."""
    left, groups = sorted(places, key=lambda one: -one.weight), list[list[_Place]]()
    while left:
        own = [one for one in left if _agree(left[0], one)]
        left = [one for one in left if not any(one is other for other in own)]
        groups.append(own)
    return sorted(groups, key=lambda group: -sum(one.weight for one in group))


def _agree(a: _Place, b: _Place) -> bool:
    """Return whether two places are one, but for what the odometry may have drifted between them."""
    apart = se2.between(se2.compose(a.pose_map_drive, b.pose), se2.compose(b.pose_map_drive, b.pose))
    drift = _DRIFT * math.dist(a.pose[:2], b.pose[:2])
    return math.hypot(apart[0], apart[1]) < _SAME_M + drift and abs(se2.wrap(apart[2])) < _SAME_RAD


def _holds(one: fit.Fit) -> bool:
    return one.tied >= _FEWEST_TIED and one.tied >= _SHARE_TIED * one.within


def _differ(a: fit.Fit, b: fit.Fit, drive: fit.Seen) -> bool:
    """Return whether two fits put the middle of the drive at places of their own."""
    middle = drive.poses[len(drive.poses) // 2, [0, 1, 3]]
    there = [
        se2.compose(one.correction.pose_map_odom[len(one.correction.pose_map_odom) // 2], middle) for one in (a, b)
    ]
    return math.hypot(*(there[0] - there[1])[:2]) > 2.0 * _SAME_M
