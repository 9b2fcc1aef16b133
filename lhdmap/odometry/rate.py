"""The adaptive rate: which scans are worth matching."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.odometry.settings import OdometrySettings

_FIRST_SCANS = 10  # processed at any speed: a map of one scan knows little


class AdaptiveRate:
    """Decides which scans are processed: those after enough travel, turn or time; the first ones always."""

    def __init__(self, settings: OdometrySettings) -> None:
        self._settings = settings
        self._travel_m = self._turn_rad = self._wait_s = 0.0
        self._processed = 0

    def due(self, dt_s: float, velocity: FloatArray) -> bool:
        """Return whether the scan that comes `dt_s` after the one before is to be processed at this velocity (3,)."""
        s = self._settings
        self._travel_m += float(np.hypot(velocity[0], velocity[1])) * dt_s
        self._turn_rad += abs(float(velocity[2])) * dt_s
        self._wait_s += dt_s
        moved = self._travel_m >= s.step_m or self._turn_rad >= math.radians(s.step_deg) or self._wait_s >= s.step_s
        if not moved and self._processed >= _FIRST_SCANS:
            return False
        self._travel_m = self._turn_rad = self._wait_s = 0.0
        self._processed += 1
        return True
