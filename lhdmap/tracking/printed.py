"""Section 2.4 as printed, to be compared: raw measurements, circles through waypoints each v T_s, one gain for five states."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.messages import FloatArray
from lhdmap.tracking.circles import circle_beside, three_points
from lhdmap.tracking.equations import printed
from lhdmap.tracking.gains import PERIOD_S, held, riccati
from lhdmap.tracking.settings import TrackingSettings

_DISCOUNT, _DESIGN_MPS = 0.05, 1.4


class PrintedLaw:
    """ω = -|v1| K p: the paper gives no K, and none for reverse; this is an LQR on its printed matrices, discounted.

    Two of the five states cannot be steered, so without a discount there is no such K.
    """

    def __init__(self, model: DriveModel, settings: TrackingSettings) -> None:
        """Find K, (5,), per metre of the rear axle's way."""
        self._lengths = (model.front_m, model.rear_m)
        self._near = [0, 0]
        jacobian = np.column_stack([_slope(k, self._lengths) for k in range(5)])
        across = printed(np.zeros(5), 0.0, self._lengths)[1][:, None]
        one = settings
        both = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
        q = np.diag([one.axle_weight, one.axle_weight, 0.0, one.heading_weight, one.joint_weight])
        q += one.sum_weight * np.outer(both, both)
        a, b = held(_DESIGN_MPS * jacobian - _DISCOUNT * np.eye(5), across, PERIOD_S)
        p = riccati(a, b @ b.T / (one.rate_weight), q)
        self.gain: FloatArray = (b.T @ p @ a)[0] / (one.rate_weight + float((b.T @ p @ b)[0, 0]))
        self.gain /= _DESIGN_MPS

    def restart(self) -> None:
        """Look for the closest waypoint on the whole path again."""
        self._near = [-1, -1]

    def rate(self, motion: Motion, rear_mps: float, waypoints: FloatArray) -> float:
        """Return the joint's rate (rad/s); `waypoints` (N, 2) in the direction of the heading."""
        p = self.state(motion, rear_mps, waypoints)
        return float(-abs(rear_mps) * self.gain @ p)

    def state(self, motion: Motion, rear_mps: float, waypoints: FloatArray) -> FloatArray:
        """Return p (5,), Eq. (8): both axles beside the circles that the paper fits for each."""
        bend, ahead = motion.articulation_rad, motion.heading_rad
        back = ahead - bend
        front_m, rear_m = self._lengths
        x1 = motion.x_m - front_m * math.cos(ahead) - rear_m * math.cos(back)
        y1 = motion.y_m - front_m * math.sin(ahead) - rear_m * math.sin(back)
        found = []
        for k, (x, y, heading) in enumerate(((motion.x_m, motion.y_m, ahead), (x1, y1, back))):
            if self._near[k] < 0:
                self._near[k] = int(np.hypot(waypoints[:, 0] - x, waypoints[:, 1] - y).argmin())
            three, self._near[k] = three_points(waypoints, x, y, abs(rear_mps) * PERIOD_S, self._near[k])
            beside = circle_beside(three, x, y)
            turned = (heading - beside.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
            found.append((beside.offset_m, turned))
        return np.array([found[0][0], found[1][0], found[0][1], found[1][1], bend])


def _slope(k: int, lengths: tuple[float, float]) -> FloatArray:
    step = np.zeros(5)
    step[k] = 1e-5
    return (printed(step, 0.0, lengths)[0] - printed(-step, 0.0, lengths)[0]) / 2e-5
