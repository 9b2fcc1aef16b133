"""Points in a convex polygon."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray


def inside(points: FloatArray, corners: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which points (N, 2) are within a convex polygon, bool (N,); corners (K, 2) counterclockwise; none of none."""
    within = np.full(len(points), len(corners) > 0)
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side = (other[0] - one[0]) * (points[:, 1] - one[1]) - (other[1] - one[1]) * (points[:, 0] - one[0])
        within &= side > 0.0
    return within
