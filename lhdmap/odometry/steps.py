"""What the planar odometry says of each scan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

BY_DEFINITION = 1e8 * np.eye(3)  # information of the pose that defines a frame


class WheelStep(NamedTuple):
    """Motion of the body by the wheels since the scan before: forward (m) and turn (rad) with standard deviations.

    `None` for what is not measured.
    """

    forward_m: float
    forward_sigma_m: float
    turn_rad: float | None
    turn_sigma_rad: float


class Matched(NamedTuple):
    """What a matcher says of one scan.

    `information` (3, 3) of the scan alone in `odom` axes, residual, share of hits that agree, whether the scan could not be
    placed (the pose is then the prediction), whether it was placed where the motion did not foretell it, now or a moment ago, and
    whether just now.
    """

    information: FloatArray
    residual_m: float
    support: float
    lost: bool
    doubtful: bool = False
    jumped: bool = False


class OdometryStep(NamedTuple):
    """Outcome of one scan.

    `T_odom_base`: planar pose (3,) at `time_ns`, the middle of the sweep: there an error of the speed that undid the sweep does
    not move the scan as a whole; `covariance`: (3, 3) of the step from the scan before, in body axes (m, rad);
    `information`: (3,) along, across (1/m²) and heading (1/rad²) of this scan against the map, the others given;
    `degenerate`: a direction was not observed; `substitute`: what stood in for it (`wheels`, `motion` or empty);
    `processed`: False where the adaptive rate only predicted; `lost`: the scan did not fit the map; `wheels`: what became of the
    wheels' step before it, and why (`WheelUse`).
    """

    stamp_ns: int
    time_ns: int
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


@nb.njit(cache=True)
def body_information(H_map: FloatArray, heading_rad: float) -> FloatArray:
    """Return H (3, 3) in the body's axes."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.ascontiguousarray(R.T) @ np.ascontiguousarray(H_map) @ R


@nb.njit(cache=True)
def marginal_information(H: FloatArray) -> FloatArray:
    """Return for each axis the information left when the other two are unknown: 1 / diag(H^-1), shape (3,).

    A direction that only shows together with another (along and heading in a bend) counts as unobserved here.
    """
    out = np.zeros(3)
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        a, b, d = H[i, i] + 1e-9, H[i, j], H[j, j] + 1e-9
        u, v = H[axis, i], H[axis, j]
        out[axis] = max(H[axis, axis] - (u * u * d - 2.0 * u * v * b + v * v * a) / (a * d - b * b), 0.0)
    return out


def inflated(covariance: FloatArray, axis: int, factor: float) -> FloatArray:
    """Return a covariance (3, 3) with the variance of one axis times a factor, correlations kept."""
    scale = np.ones(3)
    scale[axis] = math.sqrt(factor)
    return covariance * np.outer(scale, scale)
