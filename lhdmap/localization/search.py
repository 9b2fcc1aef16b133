"""Where on the whole map: the walls of the last metres are laid over the map's in all headings and shifts (`lhdmap.update.place`).

The best places are refined against the fused walls and judged by support. A place is proposed when the second best is worse by a
margin; it counts once the tracker that was started there has kept its support for some metres.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits, Match, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT
from lhdmap.scan_matching.surface_map import SurfaceMap
from lhdmap.topology.sheet import Sheet
from lhdmap.update.place import Candidate, WallSearch

_EVERY_M = 0.5
# The overlay hardly tells where along a straight tunnel one is: its walls are as wide as its cells.
_ALONG = [(x, 0.0, 0.0) for x in np.arange(-5.2, 5.3, 0.8).tolist()]
_AROUND = [(0.0, y, math.radians(a)) for y in (-0.4, 0.0, 0.4) for a in (-2.0, 0.0, 2.0)]
_FEW_HITS = 150
_LOOSE = np.diag([1.0 / 1.0**2, 1.0 / 1.0**2, 1.0 / math.radians(5.0) ** 2])
_HITS = 600


class Found(NamedTuple):
    """A place (3,) of the machine now, its support, the height of its level, how much better than the next (share)."""

    pose: FloatArray
    support: float
    height_m: float
    margin: float


class RecentWay:
    """The hits of the last metres in the odometry's frame."""

    def __init__(self, window_m: float) -> None:
        self._window_m = window_m
        self._parts: deque[tuple[float, FloatArray]] = deque()
        self._last_m = -math.inf

    def add(self, travelled_m: float, T_odom_base: FloatArray, points: FloatArray) -> None:
        """Take the hits (N, 2) of a scan in the machine's frame."""
        if travelled_m - self._last_m < _EVERY_M:
            return
        self._last_m = travelled_m
        self._parts.append((travelled_m, se2.transform(T_odom_base, points)))
        while travelled_m - self._parts[0][0] > self._window_m:
            self._parts.popleft()

    @property
    def length_m(self) -> float:
        """Way that the hits are of."""
        return self._parts[-1][0] - self._parts[0][0] if self._parts else 0.0

    def walls(self) -> FloatArray:
        """Return the hits (N, 2), thinned to cells of 0.2 m."""
        points = np.concatenate([np.zeros((0, 2)), *(part for _, part in self._parts)])
        _, first = np.unique(np.floor(points / 0.2).astype(np.int64), axis=0, return_index=True)
        thinned: FloatArray = points[np.sort(first)]
        return thinned


class GlobalSearch:
    """Searches a map's sheets."""

    def __init__(self, sheets: list[Sheet], walls: MapWalls, settings: LocalizationSettings) -> None:
        self._searches = [WallSearch(sheet) for sheet in sheets]
        self._walls, self._settings = walls, settings

    def places(self, way: RecentWay, T_odom_base: FloatArray) -> list[Found]:
        """Return the likeliest places of the machine, the best first, each at a place of its own."""
        points = way.walls()
        if len(points) < 50:
            return []
        candidates = [(one, search.sheet) for search in self._searches for one in search.best(points, 6)]
        candidates.sort(key=lambda pair: -pair[0].score)
        found: list[Found] = []
        for candidate, sheet in candidates[:8]:
            refined = self._refined(candidate, sheet, points, T_odom_base)
            if refined is not None and not any(_same(refined.pose, other.pose) for other in found):
                found.append(refined)
        found.sort(key=lambda one: -one.support)
        second = found[1].support if len(found) > 1 else 0.0
        return [
            one._replace(margin=1.0 - second / max(one.support, 1e-9)) if k == 0 else one for k, one in enumerate(found)
        ]

    def _refined(self, candidate: Candidate, sheet: Sheet, points: FloatArray, T_odom_base: FloatArray) -> Found | None:
        """Match the walls of the last metres as one scan, from several starts around a candidate."""
        local = se2.transform(se2.inverse(T_odom_base), points)
        near = local[np.hypot(local[:, 0], local[:, 1]) < 40.0]
        near = near[:: max(len(near) // _HITS, 1)]
        few = near[:: max(len(near) // _FEW_HITS, 1)]
        pose = se2.compose(candidate.T_map_drive, T_odom_base)
        walls, origin = self._walls.around(np.array([pose[0], pose[1], sheet.height_m]))
        local_pose = pose - np.array([origin[0], origin[1], 0.0])
        coarse = _matched(walls, few, local_pose, _ALONG)
        best = _matched(walls, near, coarse.pose, _AROUND)
        if best.support <= 0.0:
            return None
        return Found(best.pose + np.array([origin[0], origin[1], 0.0]), float(best.support), sheet.height_m, 0.0)


def _matched(
    walls: SurfaceMap, points: FloatArray, pose: FloatArray, starts: list[tuple[float, float, float]]
) -> Match:
    """Return the best of the matches of points (N, 2) from starts (x, y, turn in the machine's axes) about a pose (3,)."""
    hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
    found = []
    for offset in starts:
        start = se2.compose(pose, np.array(offset))
        found.append(match(walls, hits, Prior(start, _LOOSE), start, OTHER_VISIT))
    best: Match = max(found, key=lambda one: one.support)
    return best


def _same(a: FloatArray, b: FloatArray) -> bool:
    return math.hypot(a[0] - b[0], a[1] - b[1]) < 3.0 and abs(math.remainder(a[2] - b[2], 2.0 * math.pi)) < 0.35
