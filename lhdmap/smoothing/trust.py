"""How far a map may be off at its end: what the steps between key scans say, put together, after loops were closed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.graph import chained_covariance
from lhdmap.smoothing.keys import KeyScan, KeyScans

_SHARE = 0.95
_TWO_SIDED = 1.96  # standard deviations that hold 95 % of the errors of one number
_MOST_HEADING_DEG = 180.0


class ExpectedError(NamedTuple):
    """How far the last pose may be off against the first, 95 %: in the plane (m), of the distance (%), heading (°), height (m).

    `height_m` is None where no inclinometer tells the height. `lower_bound`: on a stretch of `unseen_m` neither walls nor wheels told
    the motion in one direction, so the error may be larger.
    """

    end_m: float
    end_pct: float
    heading_deg: float
    height_m: float | None
    lower_bound: bool
    unseen_m: float


def radius_m(covariance: FloatArray) -> float:
    """Return the radius (m) that 95 % of the errors in the plane are within; `covariance`, shape (2, 2) or larger.

    The sum of two squares of different size is taken for a scaled chi-square of the same mean and variance (Satterthwaite).
    """
    from scipy.special import gammaincinv

    sizes = np.maximum(np.linalg.eigvalsh(covariance[:2, :2]), 0.0)
    mean, variance = float(sizes.sum()), 2.0 * float((sizes**2).sum())
    if variance <= 0.0:
        return 0.0
    freedom = 2.0 * mean**2 / variance
    return math.sqrt(variance / mean * float(gammaincinv(0.5 * freedom, _SHARE)))
