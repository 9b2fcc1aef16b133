"""The local map: hits of the last metres in `odom`, thinned.

A tilted scanner sees the foot of a wall from afar and its shoulder from near by: what was seen on the way here is what the bodies
may touch, so the memory is as long as that takes.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray

_EVERY_M, _EVERY_RAD = 0.5, math.radians(8.0)
_CELL_M = 0.05
_RANGE_M = 25.0


class LocalWalls:
    """Takes scans with the pose at which they were taken; tells the hits around."""

    def __init__(self, memory_m: float) -> None:
        self._memory_m = memory_m
        self._kept: deque[tuple[float, FloatArray]] = deque()
        self._newest = np.zeros((0, 2))
        self._last: FloatArray | None = None
        self._travelled_m = 0.0
        self._key: FloatArray | None = None

    def add(self, T_odom_base: FloatArray, points: FloatArray) -> None:
        """Take hits (N, 2) in `base_link`, seen from a pose (3,)."""
        near = points[np.hypot(points[:, 0], points[:, 1]) < _RANGE_M]
        self._newest = se2.transform(T_odom_base, near)
        if self._last is not None:
            self._travelled_m += math.dist(self._last[:2], T_odom_base[:2])
        self._last = T_odom_base.copy()
        if self._key is not None and not self._is_new(T_odom_base):
            return
        self._key = T_odom_base.copy()
        self._kept.append((self._travelled_m, _thinned(self._newest)))
        while self._travelled_m - self._kept[0][0] > self._memory_m:
            self._kept.popleft()

    def _is_new(self, pose: FloatArray) -> bool:
        assert self._key is not None  # noqa: S101  # asked for after the first one alone
        turned = abs(math.remainder(pose[2] - self._key[2], 2.0 * math.pi))
        return math.dist(self._key[:2], pose[:2]) >= _EVERY_M or turned > _EVERY_RAD

    def points(self) -> FloatArray:
        """Return the hits (N, 2) in `odom`, the newest scan's among them."""
        return np.concatenate([self._newest, *(part for _, part in self._kept)])

    def clear(self) -> None:
        """Forget all: the pose has jumped."""
        self._kept.clear()
        self._newest, self._key, self._last = np.zeros((0, 2)), None, None


def _thinned(points: FloatArray) -> FloatArray:
    cells = np.floor(points / _CELL_M).astype(np.int64)
    _, first = np.unique(cells[:, 0] * 1_000_003 + cells[:, 1], return_index=True)
    thinned: FloatArray = points[np.sort(first)]
    return thinned
