"""Where a charge with a held joint lands: Eqs. (3) to (5) of the autonomous-loading paper.

With the joint held the whole machine turns about one centre, so each corner of the bucket's lip runs along a circle. It lands on
the pile where that circle meets the segment from E_R to E_L.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray

_STRAIGHT_PM = 1e-4  # below: a line, 5 mm off the circle after 10 m


class Lands(StrEnum):
    """Where a path meets the pile: between its limits, beside them."""

    INSIDE = "inside"
    LEFT = "left"
    RIGHT = "right"


class Crossing(NamedTuple):
    """Where a path meets the line through the limits: its share from E_R (0) to E_L (1), and the way to it; NaN: never."""

    share: float
    way_m: float


def curvature_pm(bend_rad: float, model: DriveModel) -> float:
    """Return K of Eq. (3), 1/m, of the front axle at a held joint, positive to the left: Eq. (1) with ω = 0."""
    return math.sin(bend_rad) / (model.front_m * math.cos(bend_rad) + model.rear_m)


def shares(
    right_m: FloatArray, left_m: FloatArray, center_m: FloatArray, radius_m: float
) -> tuple[float, float] | None:
    """Return S_1 and S_2, where a circle meets the line from E_R (0) to E_L (1); None where it does not.

    Eqs. (4) and (5), the latter corrected: S = (2 E·EC ∓ √Δ) / (2 |E|²), with EC from E_R to C (errata; as printed the sign
    and the square are wrong). All in one frame, shape (2,), metres.
    """
    E, EC = left_m - right_m, center_m - right_m
    square, along = float(E @ E), float(E @ EC)
    delta = (2.0 * along) ** 2 - 4.0 * square * (float(EC @ EC) - radius_m**2)
    if delta < 0.0 or square == 0.0:
        return None
    root = math.sqrt(delta)
    return (2.0 * along - root) / (2.0 * square), (2.0 * along + root) / (2.0 * square)


def side_of(found: tuple[float, float] | None, bend_side: float) -> Lands:
    """Return on which side a circular path passes, by the paper's rule of both shares.

    `bend_side`: the curvature, for a circle that meets the line nowhere: it turns away to that side.
    """
    if found is None:
        return Lands.LEFT if bend_side > 0.0 else Lands.RIGHT
    if any(0.0 < share < 1.0 for share in found):
        return Lands.INSIDE
    nearest_right = min(abs(share) for share in found)
    nearest_left = min(abs(share - 1.0) for share in found)
    return Lands.RIGHT if nearest_right < nearest_left else Lands.LEFT


def crossing(point_m: FloatArray, curvature: float, limits_m: FloatArray) -> Crossing:
    """Return where a point of the machine first meets the line through the limits, driving forward; frame `base_link`.

    Of the two solutions the paper takes any; the one that is met first within half a turn ahead counts here, for the other one
    lies behind the machine or behind the pile. `limits_m` (2, 2): E_R, E_L; `curvature` of `base_link` (1/m); `way_m` along the
    point's circle.
    """
    right_m, left_m = limits_m
    if abs(curvature) < _STRAIGHT_PM:
        E = left_m - right_m
        if abs(E[1]) < 1e-9:
            return Crossing(math.nan, math.nan)
        share = float((point_m[1] - right_m[1]) / E[1])
        way = float(right_m[0] + share * E[0] - point_m[0])
        return Crossing(share, way) if way >= 0.0 else Crossing(math.nan, math.nan)
    center = np.array([0.0, 1.0 / curvature])
    arm = point_m - center
    radius = float(np.hypot(arm[0], arm[1]))
    found = shares(right_m, left_m, center, radius)
    best = Crossing(math.nan, math.inf)
    for share in found or ():
        to = right_m + share * (left_m - right_m) - center
        turned = math.copysign(1.0, curvature) * math.atan2(arm[0] * to[1] - arm[1] * to[0], float(arm @ to))
        if 0.0 <= radius * turned < best.way_m:
            best = Crossing(share, radius * turned)
    return best if math.isfinite(best.way_m) else Crossing(math.nan, math.nan)


def lands(one: Crossing, curvature: float) -> Lands:
    """Return on which side of the pile a crossing is."""
    if math.isnan(one.share):
        return Lands.LEFT if curvature > 0.0 else Lands.RIGHT
    if one.share <= 0.0:
        return Lands.RIGHT
    return Lands.INSIDE if one.share < 1.0 else Lands.LEFT


class Landing(NamedTuple):
    """How both corners of the lip land; `way_m` until the first one does (NaN: none)."""

    left: Lands
    right: Lands
    way_m: float
    middle: float

    @property
    def good(self) -> bool:
        """Whether both land between the limits."""
        return self.left == Lands.INSIDE and self.right == Lands.INSIDE


def landing(curvature: float, corners_m: FloatArray, limits_m: FloatArray) -> Landing:
    """Return how the corners (2, 2) of the lip, left and right, land on limits (2, 2): E_R, E_L; all in `base_link`.

    The paper draws the circles of the machine's sides (Fig. 12); the lip's corners are what meets the pile.
    `middle`: share at which the middle between both lands.
    """
    left, right = (crossing(corner, curvature, limits_m) for corner in corners_m)
    ways = [one.way_m for one in (left, right) if math.isfinite(one.way_m)]
    return Landing(
        lands(left, curvature),
        lands(right, curvature),
        min(ways) if ways else math.nan,
        0.5 * (left.share + right.share),
    )
