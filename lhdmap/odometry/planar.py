"""Planar odometry as a stage: scans in, poses of `base_link` in the level plane out, one for each scan."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.anchored import Anchored, AnchoredMatcher
from lhdmap.odometry.scan_points import NO_BOXES, planar_points
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, SearchSettings
from lhdmap.odometry.steps import OdometryStep, WheelSpeed, body_information, marginal_information

_LONGEST_STEP_S = 1.0
_NO_WHEELS = WheelSpeed(None, None)


class PlanarOdometry:
    """Anchored odometry with an adaptive frame rate.

    `update` takes scans in time order with the pose of the sensor in the machine's level frame, and the wheels' speeds since
    the scan before where there are any.
    """

    def __init__(
        self,
        settings: OdometrySettings | None = None,
        anchor: AnchorSettings | None = None,
        wide: SearchSettings | None = None,
    ) -> None:
        self._settings = settings or OdometrySettings()
        self._matcher = AnchoredMatcher(self._settings, anchor or AnchorSettings(), wide or SearchSettings())
        self._last_ns: int | None = None
        self._since_s = 0.0
        self._since = np.zeros(2)  # travel and turn since the last processed scan
        self._processed = 0
        self._wheels_used = False

    def update(
        self, scan: LaserScan, T_level_sensor: FloatArray, wheels: WheelSpeed = _NO_WHEELS, boxes_m: FloatArray = NO_BOXES
    ) -> OdometryStep:
        """Process one scan; `T_level_sensor` (4, 4): mount and attitude; `boxes_m` (K, 6): the machine's own bodies."""
        dt_s = self._elapsed(scan.stamp_ns)
        self._advance(dt_s, wheels)
        if not self._due():
            return self._step(scan.stamp_ns, None)
        floor_m = self._settings.min_height_m if T_level_sensor[2, 3] > 2.0 * self._settings.min_height_m else -math.inf
        points = planar_points(scan, T_level_sensor, self._matcher.velocity, floor_m, boxes_m)
        result = self._matcher.step(points)
        self._processed += 1
        step = self._step(scan.stamp_ns, result)
        self._since_s, self._since[:] = 0.0, 0.0
        return step

    def _elapsed(self, stamp_ns: int) -> float:
        """Return the time since the scan before; a stamp that runs backwards counts as no time."""
        previous, self._last_ns = self._last_ns, stamp_ns if self._last_ns is None else max(stamp_ns, self._last_ns)
        return 0.0 if previous is None else max(stamp_ns - previous, 0) * 1e-9

    def _advance(self, dt_s: float, wheels: WheelSpeed) -> None:
        s = self._settings
        before = self._matcher.state[:3].copy()
        if wheels.forward_mps is not None:
            self._wheels_used = self._matcher.fuse_speed(3, wheels.forward_mps, s.wheel_noise_mps, scaled=True)
        if wheels.turning_rps is not None:
            self._matcher.fuse_speed(5, wheels.turning_rps, s.wheel_turn_noise_rps, scaled=False)
        # After a long gap the old speed says little: the model runs for a second at most, its uncertainty for the whole gap.
        self._matcher.predict(min(dt_s, _LONGEST_STEP_S))
        if dt_s > _LONGEST_STEP_S:
            self._matcher.P[3:6, 3:6] += np.diag([4.0, 0.1, 0.5])
        self._since += [np.hypot(*(self._matcher.state[:2] - before[:2])), abs(self._matcher.state[5]) * dt_s]
        self._since_s += dt_s

    def _due(self) -> bool:
        """Adaptive rate: process once the machine has moved, turned or waited enough; the first scans always."""
        s = self._settings
        return (
            self._processed < 10
            or self._since[0] >= s.step_m
            or self._since[1] >= math.radians(s.step_deg)
            or self._since_s >= s.step_s
        )

    def _step(self, stamp_ns: int, result: Anchored | None) -> OdometryStep:
        pose, velocity = self._matcher.state[:3].copy(), self._matcher.velocity.copy()
        covariance = self._covariance()
        if result is None:
            return OdometryStep(
                stamp_ns, pose, covariance, velocity, np.zeros(3), math.nan, math.nan, False, "", False, False
            )
        information = marginal_information(body_information(result.information, pose[2]))
        weak = self._weak(information) or result.lost
        substitute = ("wheels" if self._wheels_used else "motion") if weak else ""
        return OdometryStep(
            stamp_ns, pose, covariance, velocity, information, result.residual_m, result.support, weak, substitute, True, result.lost
        )

    def _weak(self, information: FloatArray) -> bool:
        s = self._settings
        limits = np.array([s.weak_sigma_m, s.weak_sigma_m, math.radians(s.weak_sigma_deg)])
        return bool((information * limits**2 < 1.0).any())

    def _covariance(self) -> FloatArray:
        heading = float(self._matcher.state[2])
        return body_information(self._matcher.P[:3, :3], heading)
