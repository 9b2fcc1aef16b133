"""What stands in the way of a machine on a site: points that it sees, beside the way that it drives."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.messages import FloatArray, PointCloud
from lhdmap.tracking.path import beside, nearest
from lhdmap.tracking.reference import Curve

_ROOM_M = 0.5  # beside the bodies
_BEFORE_M, _MORE_M = (
    5.0,
    2.0,
)  # it stands so far before a thing; and goes on when nothing is in the way this much farther on
_REACTION_S = 0.3
_LOOK_M = 60.0


class SiteSight:
    """Takes clouds; `blocked` says whether the machine has to stop now for what is on its way."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._half_m = float(np.abs([bodies.front_box_m[:, 1], bodies.rear_box_m[:, 1]]).max()) + _ROOM_M
        self._points_m = np.zeros((0, 2))
        self.stops = False

    def take(self, cloud: PointCloud, motion: Motion) -> None:
        """Take a cloud in `base_link`, placed by the motion of about its time."""
        own = cloud.points_m[:, :2].astype(np.float64)
        c, s = math.cos(motion.heading_rad), math.sin(motion.heading_rad)
        self._points_m = own[np.isfinite(own).all(axis=1)] @ np.array([[c, s], [-s, c]]) + (motion.x_m, motion.y_m)

    def blocked(self, curve: Curve, rear: FloatArray, speed_mps: float, model: DriveModel) -> bool:
        """Return whether something is on the curve within the stopping distance; `rear` (3,): pose of the rear axle."""
        gap_m = self._gap_m(curve, rear, model)
        need_m = _BEFORE_M + model.stopping_m(speed_mps, _REACTION_S)
        self.stops = gap_m < need_m + (_MORE_M if self.stops else 0.0)
        return self.stops

    def _gap_m(self, curve: Curve, rear: FloatArray, model: DriveModel) -> float:
        """Return the way from the leading end of the machine to the first point in its way, inf where there is none."""
        if not len(self._points_m):
            return math.inf
        gear, least = curve.gear, math.inf
        along = nearest(curve.rows, *rear.tolist())
        leads = model.wheelbase_m + self._bodies.front_box_m[1, 0] if gear > 0 else -self._bodies.rear_box_m[0, 0]
        for x, y in self._points_m.tolist():
            on, aside, _, _ = beside(curve.rows, x, y, along + 0.5 * gear * _LOOK_M, 0.5 * _LOOK_M, 0.5 * _LOOK_M)
            gap = gear * (on - along) - float(leads)
            if abs(aside) < self._half_m and gap > -1.0:
                least = min(least, gap)
        return least
