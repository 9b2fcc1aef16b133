"""Key scans: what the smoother keeps of the drive, one each metre, and fewer where it has seen the place often (`places`)."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.places import Places
from lhdmap.scan_matching.step_error import NO_ERROR, StepError
from lhdmap.smoothing.settings import SmoothingSettings


class KeyScans:
    """Collects key scans while the odometry runs.

    `travelled_m`: so far; `rest`: error of the way from the last key to the last scan, whose pose (3,) is `last`; `unseen_m`:
    longest stretch on which neither walls nor wheels told the motion in all directions.
    """

    def __init__(self, settings: SmoothingSettings) -> None:
        self._settings = settings
        self.keys: list[KeyScan] = []
        self.travelled_m = self.unseen_m = self._unseen_m = 0.0
        self.last: FloatArray | None = None
        self.rest = NO_ERROR
        self._places = Places(settings.key_m)

    def update(
        self, time_ns: int, pose: FloatArray, points: FloatArray, error: StepError = NO_ERROR, *, unseen: bool = False
    ) -> None:
        """Take a processed scan: pose (3,) in `odom`, hits (N, 3) in the level base frame, what its step may be off.

        `unseen`: neither walls nor wheels told this step in all directions.
        """
        if self.last is not None:
            self._go_on(se2.between(self.last, pose), error, unseen=unseen)
        self.last = pose.copy()
        if self._due(pose) and len(points) > 0 and self._places.wants(pose, points[:, 2].mean(), self.travelled_m):
            self.keys.append(KeyScan(time_ns, pose.copy(), self.travelled_m, points.astype(np.float32), self.rest))
            self.rest = NO_ERROR._replace(jitter=error.jitter)

    def _go_on(self, step: FloatArray, error: StepError, *, unseen: bool) -> None:
        length_m = math.hypot(step[0], step[1])
        self.travelled_m += length_m
        self._unseen_m = self._unseen_m + length_m if unseen else 0.0
        self.unseen_m = max(self.unseen_m, self._unseen_m)
        self.rest = self.rest.then(step, error)

    def _due(self, pose: FloatArray) -> bool:
        if not self.keys:
            return True
        step = se2.between(self.keys[-1].pose, pose)
        far = float(np.hypot(step[0], step[1])) >= self._settings.key_m
        return far or abs(step[2]) >= math.radians(self._settings.key_deg)
