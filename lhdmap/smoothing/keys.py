"""Key scans: what the smoother keeps of the drive, one each metre, and fewer where it has seen the place often (`places`)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.smoothing.places import Places
from lhdmap.smoothing.settings import SmoothingSettings


class KeyScan(NamedTuple):
    """A scan kept: time, pose (3,) by odometry, distance travelled, hits (N, 3), and whether the odometry was weak before it.

    The hits are in the level base frame; `weak` tells of the way since the key before.
    """

    time_ns: int
    pose: FloatArray
    travelled_m: float
    points: Float32Array
    weak: bool


class KeyScans:
    """Collects key scans while the odometry runs."""

    def __init__(self, settings: SmoothingSettings) -> None:
        self._settings = settings
        self.keys: list[KeyScan] = []
        self._travelled_m = 0.0
        self._last: FloatArray | None = None
        self._weak = False
        self._places = Places(settings.key_m)

    def update(self, time_ns: int, pose: FloatArray, points: FloatArray, *, weak: bool) -> None:
        """Take a processed scan: pose (3,) in `odom`, hits (N, 3) in the level base frame."""
        if self._last is not None:
            self._travelled_m += math.hypot(pose[0] - self._last[0], pose[1] - self._last[1])
        self._last = pose.copy()
        self._weak |= weak
        if self._due(pose) and len(points) > 0 and self._places.wants(pose, points[:, 2].mean(), self._travelled_m):
            self.keys.append(KeyScan(time_ns, pose.copy(), self._travelled_m, points.astype(np.float32), self._weak))
            self._weak = False

    def _due(self, pose: FloatArray) -> bool:
        if not self.keys:
            return True
        step = se2.between(self.keys[-1].pose, pose)
        far = float(np.hypot(step[0], step[1])) >= self._settings.key_m
        return far or abs(step[2]) >= math.radians(self._settings.key_deg)
