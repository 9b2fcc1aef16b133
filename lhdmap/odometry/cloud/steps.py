"""What the odometry of 3D scanners says of each cloud, and the small geometry of its steps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry.twist import exp
from lhdmap.messages import FloatArray

_TURNS_DEG = (10.0, -10.0, 20.0, -20.0)  # tried where the prediction failed: half of it is within reach of a match


class CloudStep(NamedTuple):
    """Outcome of one cloud; as `OdometryStep`, in space.

    `T_odom_base`: pose (4, 4) at the stamp; `covariance`: (6, 6) of the pose against the local map, that is of the
    step, as a twist in body axes, rotation (rad) before translation (m); `velocity`: forward, lateral (m/s), turning
    (rad/s); `information`: (3,) along, across (1/m²) and heading (1/rad²) of this cloud against the map, the other five
    unknown; `residual_m`: rms distance of the points that agree with the map; `support`: their share; `degenerate`: a
    direction was not observed; `substitute`: what stood in for it (`wheels`, `motion` or empty); `processed`: False
    where the adaptive rate only predicted; `lost`: the cloud did not fit the map where it could be (the pose is the
    prediction), or only after a jump that no machine makes.
    """

    stamp_ns: int
    T_odom_base: FloatArray
    covariance: FloatArray
    velocity: FloatArray
    information: FloatArray
    residual_m: float
    support: float
    degenerate: bool
    substitute: str
    processed: bool
    lost: bool
    wheels: str = "none"


def marginal_information(H: FloatArray) -> FloatArray:
    """Return for each of the six components the information left when the other five are unknown, shape (6,)."""
    return 1.0 / np.diag(np.linalg.inv(H + 1e-6 * np.eye(6)))


def starts_along(pose: FloatArray, reach_m: float, spacing_m: float, *, turned: bool = False) -> tuple[FloatArray, ...]:
    """Return poses (4, 4) along the machine's axis to either side of `pose`, and turned ones where wanted."""
    count = math.ceil(reach_m / spacing_m - 0.5)
    shifts = [k * spacing_m for i in range(1, count + 1) for k in (i, -i)]
    turns = [math.radians(turn_deg) for turn_deg in _TURNS_DEG] if turned else []
    twists = [(0.0, 0.0, 0.0, shift, 0.0, 0.0) for shift in shifts] + [
        (0.0, 0.0, turn, 0.0, 0.0, 0.0) for turn in turns
    ]
    return tuple(pose @ exp(np.array(twist)) for twist in twists)


def travel_m(T: FloatArray) -> float:
    """Return how far a motion (4, 4) goes, m."""
    return float(np.linalg.norm(T[:3, 3]))


def turn_rad(T: FloatArray) -> float:
    """Return how far a motion (4, 4) turns, rad."""
    return math.acos(min(max(0.5 * (float(np.trace(T[:3, :3])) - 1.0), -1.0), 1.0))
