"""The two bodies of a centre-articulated machine: where one axle is as the other and the joint say.

`bend_rad`: heading of the front body less that of the rear one, positive when the machine bends to the left. `front_m`, `rear_m`:
from the joint to the front and to the rear axle.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray


def rear_axle(
    x_m: float, y_m: float, heading_rad: float, bend_rad: float, front_m: float, rear_m: float
) -> tuple[float, float, float]:
    """Return x, y (m) and heading (rad) of the rear axle from those of the front one, in the same frame."""
    back = heading_rad - bend_rad
    x = x_m - front_m * math.cos(heading_rad) - rear_m * math.cos(back)
    y = y_m - front_m * math.sin(heading_rad) - rear_m * math.sin(back)
    return x, y, back


@nb.njit(cache=True, nogil=True)
def T_base_rear(bend_rad: float, front_m: float, rear_m: float) -> FloatArray:  # noqa: N802  # frames in the name
    """Return the pose of `rear_link` in `base_link`, shape (4, 4): both on one plane, joined by the upright joint."""
    c, s = np.cos(bend_rad), np.sin(bend_rad)
    T = np.eye(4)
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, s, -s, c  # the rear body is turned by -bend
    T[0, 3], T[1, 3] = -front_m - rear_m * c, rear_m * s
    return T


@nb.njit(cache=True, nogil=True)
def T_rear_base(bend_rad: float, front_m: float, rear_m: float) -> FloatArray:  # noqa: N802  # frames in the name
    """Return the pose of `base_link` in `rear_link`, shape (4, 4)."""
    c, s = np.cos(bend_rad), np.sin(bend_rad)
    T = np.eye(4)
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, -s, s, c
    T[0, 3], T[1, 3] = rear_m + front_m * c, front_m * s
    return T
