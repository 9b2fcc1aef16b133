"""The tracker: a pose on the map, carried on by the odometry and corrected by the map's walls.

The information of a match is divided by the node's κ: neighbouring hits share the map's errors. So do neighbouring scans: over a
metre of travel they say no more than one, and a machine that stands learns nothing from one scan after the other. Where the walls
say little of one direction the prediction holds there, by the information alone; residuals say nothing of it.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.quality import Quality
from lhdmap.localization.method import Corrected, Wheels
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.information import body_information, marginal_information
from lhdmap.scan_matching.matching import Hits, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT

_MAP_HEADING_RAD, _MAP_ACROSS_M = math.radians(0.03), 0.003
_SHARED_M = 1.0  # travel over which scans share the map's errors
_LEAST_SHARE = 0.02
_CLEARLY = 0.15
_AHEAD_M = 3.0  # mean distance of the hits ahead: what a wrong scale moves a scan by
_LEAST_STD = np.array([1e-3, 1e-3, 1e-5])
_PER_METRE = np.array([0.004, 0.003, math.radians(0.03)])  # of the odometry's step at least, per square root of a metre


class Tracker:
    """`pose` (3,) in `map`, `P` (3, 3) its covariance in the map's axes, `height_m` of the floor there."""

    def __init__(
        self, walls: MapWalls, settings: LocalizationSettings, pose: FloatArray, P: FloatArray, height_m: float
    ) -> None:
        self._walls, self._settings = walls, settings
        self.pose, self.P, self.height_m = pose.copy(), P.copy(), height_m
        self._moved_m = _SHARED_M  # since the last correction; the first scan counts in full

    def predict(self, step: FloatArray, covariance: FloatArray, _wheels: Wheels | None = None, /) -> None:
        """Carry the pose on by a step (3,) of the odometry with its covariance (3, 3), in the axes of its end."""
        way = math.hypot(step[0], step[1])
        self._moved_m += way
        noise = covariance + np.diag((_PER_METRE * math.sqrt(way)) ** 2)
        before = self.pose
        self.pose = se2.compose(before, step)
        dx, dy = self.pose[0] - before[0], self.pose[1] - before[1]
        F = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        R = turned(self.pose[2])
        self.P = F @ self.P @ F.T + R @ noise @ R.T

    def correct(self, points: FloatArray, front: int, quality: Quality, /) -> Corrected:
        """Match hits (N, 2) in the machine's frame, the first `front` of the front scanner, and take over what they say."""
        walls, origin = self._walls.around(np.array([self.pose[0], self.pose[1], self.height_m]))
        hits = Hits(np.column_stack([points, np.zeros(len(points))]), front, layered=False)
        share = min(max(self._moved_m / _SHARED_M, _LEAST_SHARE), 1.0)
        kappa = (quality.kappa if math.isfinite(quality.kappa) else 10.0) / share
        self._moved_m = 0.0
        local = self.pose - np.array([origin[0], origin[1], 0.0])
        information: FloatArray = np.asarray(np.linalg.inv(self.P + np.diag(_LEAST_STD**2)), dtype=float)
        found = match(walls, hits, Prior(local, np.asarray(kappa * information, dtype=float)), local, OTHER_VISIT)
        along = float(marginal_information(body_information(found.information, found.pose[2]))[0])
        if found.support <= 0.0:
            return Corrected(0.0, 0.0)
        self.pose = found.pose + np.array([origin[0], origin[1], 0.0])
        posterior = np.linalg.inv(information + found.information / kappa)
        scale = abs(quality.scale) if math.isfinite(quality.scale) else 0.003
        R = turned(self.pose[2])
        map_error = R @ np.diag([(scale * _AHEAD_M) ** 2, _MAP_ACROSS_M**2, _MAP_HEADING_RAD**2]) @ R.T
        self.P = np.asarray(posterior + 0.5 * (map_error + map_error.T), dtype=float)
        return Corrected(float(found.support), along)

    def turn_if_better(self, points: FloatArray) -> None:
        """Turn round about where the machine is, where hits (N, 2) fit the walls clearly better so."""
        walls, origin = self._walls.around(np.array([self.pose[0], self.pose[1], self.height_m]))
        hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
        supports = []
        for turn in (0.0, math.pi):
            start = self.pose + np.array([-origin[0], -origin[1], turn])
            supports.append(
                match(
                    walls, hits, Prior(start, np.asarray(np.linalg.inv(self.P), dtype=float)), start, OTHER_VISIT
                ).support
            )
        if supports[1] > supports[0] + _CLEARLY:
            self.pose[2] += math.pi

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations (3,) along, across and of the heading, in the machine's axes."""
        R = turned(self.pose[2])
        deviations: FloatArray = np.sqrt(np.maximum(np.diag(R.T @ self.P @ R), 0.0))
        return deviations


def turned(heading_rad: float) -> FloatArray:
    """Return the matrix (3, 3) that turns covariances of (along, across, heading) into the map's axes."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
