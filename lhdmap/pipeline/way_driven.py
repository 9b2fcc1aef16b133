"""How far a machine has driven by the odometry, from scan to scan."""

from __future__ import annotations

import math

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.steps import OdometryStep


class WayDriven:
    """`stamp_ns` of the newest scan, its `pose` (3,) in `odom`, None before the first, and the way `travelled_m`."""

    def __init__(self) -> None:
        self.stamp_ns = 0
        self.pose: FloatArray | None = None
        self.travelled_m = 0.0
        self._time_ns = 0
        self._began_ns: int | None = None

    def go_on(self, stamp_ns: int, step: OdometryStep) -> tuple[FloatArray | None, int]:
        """Take a step; return the motion (3,) since the scan before, None for the first, and that scan's time."""
        self.stamp_ns = stamp_ns
        self._began_ns = stamp_ns if self._began_ns is None else self._began_ns
        moved = None if self.pose is None else se2.between(self.pose, step.pose_odom_base)
        if moved is not None:
            self.travelled_m += math.hypot(moved[0], moved[1])
        since_ns, self._time_ns = self._time_ns, step.time_ns
        self.pose = step.pose_odom_base.copy()
        return moved, since_ns

    @property
    def since_start(self) -> tuple[float, float]:
        """Time and way from the first scan to the newest (s, m)."""
        began_ns = self.stamp_ns if self._began_ns is None else self._began_ns
        return (self.stamp_ns - began_ns) * 1e-9, self.travelled_m
