"""Rear scans on their way into the odometry: the one nearest in time, placed behind the joint."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lhdmap.geometry import se3
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import LaserScan
from lhdmap.odometry.anchored.rear_view import RearView
from lhdmap.pipeline.mounts import SensorMounts
from lhdmap.proprioception.wheels import WheelOdometry
from lhdmap.scan_matching.scan_points import half_sweep_ns

_KEPT = 64  # scans: more than the inclinometer's delay at 50 Hz
AT_ONCE_NS = 30_000_000
"""How far from a moment a scan may be taken for one of that moment, where motion is measured."""
# The joint's encoder is noisy and its noise turns the whole scan: readings around the scan are averaged, as many before as after.
_AVERAGED_NS = np.arange(-4, 5) * 20_000_000


class RearScans:
    """Keeps the newest rear scans; `near` gives the one of a moment."""

    def __init__(self, mounts: SensorMounts, wheels: WheelOdometry, machine: Machine) -> None:
        self._mounts, self._wheels, self._machine = mounts, wheels, machine
        self._scans: deque[tuple[int, LaserScan]] = deque(maxlen=_KEPT)

    def hold(self, scan: LaserScan) -> None:
        """Keep a scan."""
        self._scans.append((scan.stamp_ns + half_sweep_ns(scan), scan))

    def near(self, time_ns: int, roll_rad: float, pitch_rad: float, within_ns: int = AT_ONCE_NS) -> RearView | None:
        """Return the scan nearest to `time_ns`, or None where there is none `within_ns` or the joint's angle is not known."""
        if not self._scans:
            return None
        scan_ns, scan = self._nearest(time_ns)
        angle_rad = self._articulation(scan_ns)
        if abs(scan_ns - time_ns) > within_ns or angle_rad is None:
            return None
        mount = self._mounts.of(scan.frame_id, "rear")
        if mount.parent_frame != "rear_link":
            return None
        T_level_base = se3.from_rpy(roll_rad, pitch_rad, 0.0)
        T_level_sensor = T_level_base @ T_base_rear(angle_rad, self._machine) @ mount.T_parent_child
        joint_x_m = -self._machine.dimensions.joint_to_front_axle_m
        return RearView(scan, T_level_sensor, (scan_ns - time_ns) * 1e-9, joint_x_m)

    def _nearest(self, time_ns: int) -> tuple[int, LaserScan]:
        """Return the scan nearest in time: among the newest, so the search goes backwards while it gets nearer."""
        best = self._scans[-1]
        for one in reversed(self._scans):
            if abs(one[0] - time_ns) > abs(best[0] - time_ns):
                break
            best = one
        return best

    def _articulation(self, time_ns: int) -> float | None:
        angles = self._wheels.articulations_at(time_ns + _AVERAGED_NS)
        total = float(angles.sum())
        if math.isfinite(total):
            return total / len(angles)
        both = np.isfinite(angles) & np.isfinite(angles[::-1])
        return float(angles[both].mean()) if both.any() else None
