"""Key scans: what the smoother keeps of the drive, one each metre, and fewer where it has seen the place often (`places`)."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import NO_STEP, KeyScan
from lhdmap.smoothing.places import Places
from lhdmap.smoothing.settings import SmoothingSettings

_SHORTEST_M, _PER_TURN = 0.1, 0.002


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
            key = KeyScan(time_ns, pose.copy(), self._travelled_m, points.astype(np.float32), self._weak, NO_STEP)
            if self.keys:
                key = key._replace(step_covariance=walked(self.keys[-1], key, self._settings))
            self.keys.append(key)
            self._weak = False

    def _due(self, pose: FloatArray) -> bool:
        if not self.keys:
            return True
        step = se2.between(self.keys[-1].pose, pose)
        far = float(np.hypot(step[0], step[1])) >= self._settings.key_m
        return far or abs(step[2]) >= math.radians(self._settings.key_deg)


def walked(before: KeyScan, after: KeyScan, settings: SmoothingSettings) -> FloatArray:
    """Return the covariance (3, 3) of a step between keys: a random walk with the travel, wider where weak."""
    travel_m = max(after.travelled_m - before.travelled_m, _SHORTEST_M)
    position = (settings.weak_sigma if after.weak else settings.along_sigma) * math.sqrt(travel_m)
    turn = abs(float(se2.wrap(after.pose[2] - before.pose[2])))
    heading = math.radians(settings.heading_sigma_deg) * math.sqrt(travel_m) + _PER_TURN * turn
    return np.diag([position**2, position**2, heading**2])
