"""The walls of the last metres in the odometry's frame, and their profile: kept scan by scan.

The way is kept by how far the machine has gone ahead (back counts down), so one that goes back along its way adds nothing to it;
where it turns off into another way, what lies beyond is forgotten.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.distinct import channels
from lhdmap.landmarks.profile import profile_of
from lhdmap.landmarks.scans import near
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.surface import fused
from lhdmap.localization.placing import LiveProfile
from lhdmap.messages import FloatArray
from lhdmap.topology.driven import arc_m

_EVERY_M = 0.1
_BLOCK_M = 4.0  # hits are averaged over so much travel at a time
_RANGE_M = 9.0  # of the machine's centre: farther hits graze the walls
_AHEAD_M, _BEHIND_M = 3.0, 7.0  # of wall that is seen beyond the way: as far as the rear scanner and a little more
_OFF_M = 0.7  # beside its former way by this much: another way


class _Block(NamedTuple):
    at_m: float
    points: FloatArray
    counts: FloatArray


class RecentWay:
    """Hits, poses and profile of the last `window_m`."""

    def __init__(self, window_m: float, settings: LandmarkSettings) -> None:
        self._window_m, self._settings = window_m, settings
        self._blocks: deque[_Block] = deque()
        self._fresh: list[FloatArray] = []
        self._way: deque[tuple[float, FloatArray]] = deque()  # by `ahead_m`, rising
        self._pose: FloatArray | None = None
        self._ahead_m = self._travelled_m = 0.0
        self._taken_m, self._block_m = -math.inf, 0.0

    def add(self, pose_odom_base: FloatArray, points: FloatArray) -> None:
        """Take the hits (N, 2) of a scan in the machine's frame, at a pose (3,) in `odom`."""
        forward = 0.0
        if self._pose is not None:
            step = se2.between(self._pose, pose_odom_base)
            self._travelled_m += math.hypot(step[0], step[1])
            forward = math.copysign(math.hypot(step[0], step[1]), step[0])
        self._pose = pose_odom_base.copy()
        self._ahead_m += forward
        if self._travelled_m - self._taken_m < _EVERY_M:
            return
        self._taken_m = self._travelled_m
        self._go_on(forward < 0.0)
        self._fresh.append(se2.transform(self._pose, near(points, _RANGE_M, self._settings.centre_m)))
        if self._travelled_m - self._block_m >= _BLOCK_M:
            self._block_m = self._travelled_m
            self._blocks.append(self._fused_fresh())
            self._fresh = []
        while self._blocks and self._travelled_m - self._blocks[0].at_m > self._window_m:
            self._blocks.popleft()

    def _go_on(self, back: bool) -> None:
        """Add a pose to the way, or forget what lies beyond where the machine leaves its former way."""
        assert self._pose is not None  # noqa: S101  # set by the caller
        way, here = self._way, (self._ahead_m, self._pose)
        if not way or here[0] > way[-1][0]:
            way.append(here)
        elif here[0] < way[0][0]:
            way.appendleft(here)
        else:
            same = min(way, key=lambda one: abs(one[0] - here[0]))
            if math.dist(same[1][:2], here[1][:2]) > _OFF_M:
                self._way = deque(one for one in way if (one[0] > here[0] if back else one[0] < here[0]))
                self._go_on(back)
        while self._way[-1][0] - self._way[0][0] > self._window_m:
            far_behind = self._ahead_m - self._way[0][0] > self._way[-1][0] - self._ahead_m
            if far_behind:
                self._way.popleft()
            else:
                self._way.pop()

    @property
    def length_m(self) -> float:
        """Length of the way."""
        return self._way[-1][0] - self._way[0][0] if self._way else 0.0

    def _fused_fresh(self) -> _Block:
        cells = fused(self._fresh, self._settings.cell_m)
        return _Block(self._travelled_m, cells.points_m.astype(float), cells.counts.astype(float))

    def cells(self) -> tuple[FloatArray, FloatArray]:
        """Return averaged hits (M, 2) in `odom` and their counts (M,)."""
        blocks = [*self._blocks, self._fused_fresh()] if self._fresh else list(self._blocks)
        points = np.concatenate([np.zeros((0, 2)), *(block.points for block in blocks)])
        return points, np.concatenate([np.zeros(0), *(block.counts for block in blocks)])

    def walls(self) -> FloatArray:
        """Return the hits (N, 2), thinned to cells of 0.2 m."""
        points = self.cells()[0]
        _, first = np.unique(np.floor(points / 0.2).astype(np.int64), axis=0, return_index=True)
        thinned: FloatArray = points[np.sort(first)]
        return thinned

    def snapshot(self, within_m: float = math.inf) -> RecentWindow:
        """Return what a search needs, of the way within some travel of the machine; it may run beside what goes on here."""
        points, counts = self.cells()
        way = [one for one in self._way if abs(one[0] - self._ahead_m) <= within_m]
        ends = way[0][1], way[-1][1]
        return RecentWindow(points, counts, np.array([pose[:2] for _, pose in way]), ends, way[-1][0] - way[0][0])


class RecentWindow(NamedTuple):
    """Averaged hits (M, 2) and counts (M,), the way (K, 2) from behind to ahead, the poses at its ends, its length."""

    points: FloatArray
    counts: FloatArray
    way: FloatArray
    ends: tuple[FloatArray, FloatArray]
    length_m: float

    def profile(self, settings: LandmarkSettings, noise: float) -> LiveProfile:
        """Return the profile of its walls; `noise`: see `channels`."""
        behind, ahead = self.ends
        first = se2.compose(behind, np.array([-_BEHIND_M, 0.0, 0.0]))[:2]
        last = se2.compose(ahead, np.array([_AHEAD_M, 0.0, 0.0]))[:2]
        way = np.vstack([first, self.way, last])
        profile = profile_of(self.points, self.counts, way, arc_m(way), settings)
        if not len(profile.at_m):
            return LiveProfile(np.zeros((3, 0)), np.zeros((3, 0)), np.zeros((0, 2)))
        values, variances = channels(profile, settings.profile_m, noise)
        return LiveProfile(values.T, variances.T, profile.line_m.astype(float))
