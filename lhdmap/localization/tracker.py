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
from lhdmap.scan_matching.matching import Hits, Match, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT
from lhdmap.scan_matching.surface_map import SurfaceMap

_MAP_ALONG_M, _MAP_ACROSS_M, _MAP_HEADING_RAD = 0.002, 0.003, math.radians(0.03)
_SHARED_M = 1.0  # travel over which scans share the map's errors
_LEAST_SHARE = 0.02
_LOOSE = 0.01  # of the filter's information holds a match: smooth walls pull only one that is free to follow ...
_NEAR = np.diag([1.0 / 0.5**2, 1.0 / 0.5**2, 1.0 / math.radians(3.0) ** 2])  # ... within what a match can find
_STRETCH_STD, _STRETCH_WALK = 0.01, 0.001  # of the odometry where walls tell it little of the way; growth each √m
_OF_WALLS = 0.5  # of what one scan is sure of along the machine: the map's noise, the same as long as a wall is in view
_CLEARLY = 0.15
_MODEL = OTHER_VISIT._replace(rounds=4)
_WIDE, _DOUBT_M = OTHER_VISIT._replace(noise_m=0.25), 0.05  # hits of smooth walls agree within 6 cm alone
_MOST_NOISE_M = 0.1
_AHEAD_M = 3.0  # mean distance of the hits ahead: what a wrong scale moves a scan by
_LEAST_STD = np.array([1e-3, 1e-3, 1e-5])
_PER_METRE = np.array([0.004, 0.003, math.radians(0.03)])  # of the odometry's step at least, per square root of a metre


class MapTracker:
    """`pose` (3,) in `map`, `height_m` of the floor there.

    The map is wrong by a little everywhere, and by something else a metre on: that goes into the filter with the way, and stands
    beside its covariance where that is told.
    """

    def __init__(
        self, walls: MapWalls, settings: LocalizationSettings, pose: FloatArray, P: FloatArray, height_m: float
    ) -> None:
        self._walls, self._settings = walls, settings
        self.pose, self.height_m = pose.copy(), height_m
        self.stretch = 0.0  # of the odometry against the map: so much more way than it says, as a share
        self._own = np.zeros((4, 4))  # of pose and stretch
        self._own[:3, :3], self._own[3, 3] = P, _STRETCH_STD**2
        self._map_std = np.array([_MAP_ALONG_M, _MAP_ACROSS_M, _MAP_HEADING_RAD])
        self._wall_noise_m = 0.0
        self._moved_m = _SHARED_M  # since the last correction; the first scan counts in full

    def predict(self, step: FloatArray, covariance: FloatArray, _wheels: Wheels | None = None, /) -> None:
        """Carry the pose on by a step (3,) of the odometry with its covariance (3, 3), in the axes of its end."""
        way = math.hypot(step[0], step[1])
        self._moved_m += way
        before = self.pose
        self.pose = se2.compose(before, step * np.array([1.0 + self.stretch, 1.0 + self.stretch, 1.0]))
        dx, dy = self.pose[0] - before[0], self.pose[1] - before[1]
        F = np.eye(4)
        F[:2, 2:] = [[-dy, dx], [dx, dy]]
        R = turned(self.pose[2])
        self._own = F @ self._own @ F.T
        self._own[:3, :3] += R @ (covariance + np.diag((_PER_METRE**2 + self._map_std**2 / _SHARED_M) * way)) @ R.T
        self._own[3, 3] += _STRETCH_WALK**2 * way

    def correct(self, points: FloatArray, front: int, quality: Quality, /) -> Corrected:
        """Match hits (N, 2) in the machine's frame, the first `front` of the front scanner, and take over what they say."""
        walls, origin = self._walls.around(np.array([self.pose[0], self.pose[1], self.height_m]))
        hits = Hits(np.column_stack([points, np.zeros(len(points))]), front, layered=False)
        share = min(max(self._moved_m / _SHARED_M, _LEAST_SHARE), 1.0)
        kappa = (quality.kappa if math.isfinite(quality.kappa) else 10.0) / share
        self._moved_m = 0.0
        local = self.pose - np.array([origin[0], origin[1], 0.0])
        information: FloatArray = np.asarray(np.linalg.inv(self._own[:3, :3] + np.diag(_LEAST_STD**2)), dtype=float)
        found = self._placed(walls, hits, Prior(local, _LOOSE * information + _NEAR))
        along = float(marginal_information(body_information(found.information, found.pose[2]))[0])
        if found.support <= 0.0:
            return Corrected(0.0, 0.0)
        self._fuse(found.pose - local, found.information / kappa)
        scale = abs(quality.scale) if math.isfinite(quality.scale) else 0.003
        self._map_std = np.array([math.hypot(_MAP_ALONG_M, scale * _AHEAD_M), _MAP_ACROSS_M, _MAP_HEADING_RAD])
        self._wall_noise_m = min(_OF_WALLS / math.sqrt(max(along, 1e-9)), _MOST_NOISE_M)
        return Corrected(float(found.support), along)

    def _placed(self, walls: SurfaceMap, hits: Hits, prior: Prior) -> Match:
        """Match from the prior's pose; where that is in doubt, hits may be farther from the walls at first."""
        start = prior.pose
        if self.deviations[1] > _DOUBT_M:
            start = match(walls, hits, prior, start, _WIDE).pose
        found: Match = match(walls, hits, prior, start, _MODEL)
        return found

    def _fuse(self, off: FloatArray, told: FloatArray) -> None:
        """Take over what a match told: by how much the pose is off (3,), with its information (3, 3)."""
        C = self._own[:, :3]
        gain = C @ np.linalg.inv(np.eye(3) + told @ C[:3]) @ told
        moved = gain @ off
        self.pose, self.stretch = self.pose + moved[:3], self.stretch + float(moved[3])
        own = self._own - gain @ C.T
        self._own = 0.5 * (own + own.T)

    def turn_if_better(self, points: FloatArray) -> None:
        """Turn round about where the machine is, where hits (N, 2) fit the walls clearly better so."""
        walls, origin = self._walls.around(np.array([self.pose[0], self.pose[1], self.height_m]))
        hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
        held = np.asarray(np.linalg.inv(self.P), dtype=float)
        starts = [self.pose + np.array([-origin[0], -origin[1], turn]) for turn in (0.0, math.pi)]
        supports = [self._placed(walls, hits, Prior(start, held)).support for start in starts]
        if supports[1] > supports[0] + _CLEARLY:
            self.pose[2] += math.pi

    @property
    def P(self) -> FloatArray:  # noqa: N802
        """Covariance (3, 3) of the pose, map axes: the filter's, and what the map is wrong by where the machine is."""
        R = turned(self.pose[2])
        beside = self._map_std**2 + np.array([self._wall_noise_m**2, 0.0, 0.0])
        P: FloatArray = self._own[:3, :3] + R @ np.diag(beside) @ R.T
        return P

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
