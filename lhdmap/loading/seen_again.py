"""The pile before another attempt: a machine that has backed off stands, and sees one line of the face, not its shape.

Where that line lies tells how far the face has moved since the attempt before: shape and limits are taken as they were.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.loading.moment import Target
from lhdmap.messages import FloatArray

_WITHIN = (0.15, 0.85)  # share of the width: walls are beside it
_AROUND_M = (-1.5, 5.0)  # about the toe


def face_behind_m(points_m: FloatArray, limits_m: FloatArray) -> float:
    """Return how far behind the toe the hits (N, 2) on the face lie, their median; limits (2, 2): E_R, E_L; NaN: none."""
    E = limits_m[1] - limits_m[0]
    width = float(np.hypot(*E))
    if width < 1e-3 or len(points_m) == 0:
        return math.nan
    d = points_m - limits_m[0]
    share, behind = d @ E / width**2, d @ np.array([E[1], -E[0]]) / width
    on = (share > _WITHIN[0]) & (share < _WITHIN[1]) & (behind > _AROUND_M[0]) & (behind < _AROUND_M[1])
    return float(np.median(behind[on])) if on.any() else math.nan


def moved(target: Target, shift_m: float, stamp_ns: int) -> Target:
    """Return a pile whose toe lies so far behind where it was."""
    ahead = shift_m * np.array([math.cos(target.heading_rad), math.sin(target.heading_rad)])
    return target._replace(limits_m=target.limits_m + ahead, center_m=target.center_m + ahead, stamp_ns=stamp_ns)
