"""The local map: hits of the last metres in `odom`, thinned.

A tilted scanner sees the foot of a wall from afar and its shoulder from near by: what was seen on the way here is what the bodies
may touch, so the memory is as long as that takes.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.guidance.ghosts import Eye, Ghosts
from lhdmap.messages import FloatArray

_EVERY_M, _EVERY_RAD = 0.5, math.radians(8.0)
_CELL_M = 0.05
_RANGE_M = 25.0


_STANDS_M = 0.2
_GHOSTS_EVERY = 4  # scans


class _Kept(NamedTuple):
    """Hits (N, 2) in `odom` of a scan after so much way, and from how far (N,) they were seen."""

    travelled_m: float
    points: FloatArray
    seen_m: FloatArray


class LocalWalls:
    """Takes scans with the pose at which they were taken; tells the hits around, without those of what has left."""

    def __init__(self, memory_m: float) -> None:
        self._memory_m = memory_m
        self._kept: deque[_Kept] = deque()
        self._newest = np.zeros((0, 2))
        self._last: FloatArray | None = None
        self._travelled_m = 0.0
        self._key: FloatArray | None = None
        self._stood: FloatArray | None = None
        self._ghosts: Ghosts | None = None
        self._scans = 0

    def add(self, pose_odom_base: FloatArray, points: FloatArray, eyes: Sequence[Eye] = ()) -> None:
        """Take hits (N, 2) in `base_link`, seen from a pose (3,); `eyes`: the same by scanner."""
        near = points[np.hypot(points[:, 0], points[:, 1]) < _RANGE_M]
        self._newest = se2.transform(pose_odom_base, near)
        if self._last is not None:
            self._travelled_m += math.dist(self._last[:2], pose_odom_base[:2])
        self._last = pose_odom_base.copy()
        self._drop_ghosts(pose_odom_base, eyes)
        if self._key is not None and not self._is_new(pose_odom_base):
            return
        self._key = pose_odom_base.copy()
        kept = _thinned(self._newest)
        places = [se2.transform(pose_odom_base, eye.place[None])[0] for eye in eyes]
        seen_m = [np.hypot(*(kept - place).T) for place in places] or [np.full(len(kept), np.inf)]
        self._kept.append(_Kept(self._travelled_m, kept, np.min(seen_m, axis=0)))
        self._ghosts = None
        while self._travelled_m - self._kept[0].travelled_m > self._memory_m:
            self._kept.popleft()

    def _drop_ghosts(self, pose_odom_base: FloatArray, eyes: Sequence[Eye]) -> None:
        """Forget hits that a machine that stands has seen through several times."""
        if self._stood is None or math.dist(self._stood[:2], pose_odom_base[:2]) > _STANDS_M:
            self._stood, self._ghosts, self._scans = pose_odom_base.copy(), None, 0
        self._scans += 1
        if not eyes or not self._kept or self._scans % _GHOSTS_EVERY:
            return
        if self._ghosts is None:
            parts = list(self._kept)
            hits = np.concatenate([one.points for one in parts])
            self._ghosts = Ghosts(hits, np.concatenate([one.seen_m for one in parts]))
        in_odom = [
            Eye(*(se2.transform(pose_odom_base, each) for each in (eye.place[None], eye.points))) for eye in eyes
        ]
        gone = self._ghosts.gone([Eye(eye.place[0], eye.points) for eye in in_odom])
        if gone.any():
            self._forget(gone)

    def _forget(self, gone: npt.NDArray[np.bool_]) -> None:
        """Forget hits (N,) of all that are kept."""
        parts, first = list(self._kept), 0
        self._kept.clear()
        for one in parts:
            left = ~gone[first : first + len(one.points)]
            first += len(one.points)
            self._kept.append(_Kept(one.travelled_m, one.points[left], one.seen_m[left]))
        self._ghosts = None

    def _is_new(self, pose: FloatArray) -> bool:
        assert self._key is not None  # noqa: S101  # asked for after the first one alone
        turned = abs(math.remainder(pose[2] - self._key[2], 2.0 * math.pi))
        return math.dist(self._key[:2], pose[:2]) >= _EVERY_M or turned > _EVERY_RAD

    def points(self) -> FloatArray:
        """Return the hits (N, 2) in `odom`, the newest scan's among them."""
        return np.concatenate([self._newest, *(one.points for one in self._kept)])

    def clear(self) -> None:
        """Forget all: the pose has jumped."""
        self._kept.clear()
        self._newest, self._key, self._last = np.zeros((0, 2)), None, None
        self._stood, self._ghosts = None, None


def _thinned(points: FloatArray) -> FloatArray:
    cells = np.floor(points / _CELL_M).astype(np.int64)
    _, first = np.unique(cells[:, 0] * 1_000_003 + cells[:, 1], return_index=True)
    thinned: FloatArray = points[np.sort(first)]
    return thinned
