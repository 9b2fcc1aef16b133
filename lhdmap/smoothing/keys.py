"""Key scans: what the smoother keeps of the drive, one each metre."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.odometry.step_error import NO_ERROR, StepError, measured_covariance
from lhdmap.smoothing.settings import SmoothingSettings


class KeyScan(NamedTuple):
    """A scan kept: time, pose (3,) by odometry, distance travelled, hits (N, 3), and how far the way since the key before may be off.

    The hits are in the level base frame. `error`: what the step from the key before adds to the error of the way.
    """

    time_ns: int
    pose: FloatArray
    travelled_m: float
    points: Float32Array
    error: StepError = NO_ERROR

    def covariance(self, before: KeyScan) -> FloatArray:
        """Return the covariance (3, 3) of the step from the key `before`, in this key's axes (m, rad)."""
        return measured_covariance(before.error.jitter, se2.between(before.pose, self.pose), self.error)


class KeyScans:
    """Collects key scans while the odometry runs.

    `travelled_m`: so far; `rest`: error of the way from the last key to the last scan, whose pose (3,) is `last`; `unseen_m`: longest
    stretch on which neither walls nor wheels told the motion in all directions.
    """

    def __init__(self, settings: SmoothingSettings) -> None:
        self._settings = settings
        self.keys: list[KeyScan] = []
        self.travelled_m = self.unseen_m = self._unseen_m = 0.0
        self.last: FloatArray | None = None
        self.rest = NO_ERROR

    def update(
        self, time_ns: int, pose: FloatArray, points: FloatArray, error: StepError = NO_ERROR, *, unseen: bool = False
    ) -> None:
        """Take a processed scan: pose (3,) in `odom`, hits (N, 3) in the level base frame, what its step may be off.

        `unseen`: neither walls nor wheels told this step in all directions.
        """
        if self.last is not None:
            step = se2.between(self.last, pose)
            length_m = math.hypot(step[0], step[1])
            self.travelled_m += length_m
            self._unseen_m = self._unseen_m + length_m if unseen else 0.0
            self.unseen_m = max(self.unseen_m, self._unseen_m)
            self.rest = self.rest.then(step, error)
        self.last = pose.copy()
        if self._due(pose) and len(points) > 0:
            hits = points.astype(np.float32)
            self.keys.append(KeyScan(time_ns, pose.copy(), self.travelled_m, hits, self.rest))
            self.rest = NO_ERROR._replace(jitter=error.jitter)

    def _due(self, pose: FloatArray) -> bool:
        if not self.keys:
            return True
        step = se2.between(self.keys[-1].pose, pose)
        far = float(np.hypot(step[0], step[1])) >= self._settings.key_m
        return far or abs(step[2]) >= math.radians(self._settings.key_deg)
