"""How far a map may be off at its end: what the steps between key scans say, put together, after loops were closed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.step_error import NO_ERROR, StepError
from lhdmap.smoothing.graph import chained
from lhdmap.smoothing.keys import KeyScans

_SHARE = 0.95
_TWO_SIDED = 1.96  # standard deviations that hold 95 % of the errors of one number
_SHORTEST_M = 0.1
_LONG_UNSEEN_M = 5.0  # shorter stretches are bridged by the motion model


class ExpectedError(NamedTuple):
    """How far the last pose may be off against the first, 95 %: in the plane (m), of the distance (%), heading (°), height (m).

    `height_m` is None where nothing tells the height. `lower_bound`: on a stretch of `unseen_m` neither walls nor wheels told the
    motion in one direction, so that the error may be larger.
    """

    end_m: float
    end_pct: float
    heading_deg: float
    height_m: float | None
    lower_bound: bool
    unseen_m: float


def expected_error(
    keys: KeyScans, height_std_m: float | None, closed: FloatArray | None = None
) -> ExpectedError | None:
    """Return how far the end may be off; `closed` (3, 3): covariance of the last key where loops were closed.

    None where there is no key scan.
    """
    if not keys.keys:
        return None
    covariance = _end_covariance(keys, closed)
    end_m, travelled_m = radius_m(covariance), max(keys.travelled_m, _SHORTEST_M)
    heading_deg = min(math.degrees(_TWO_SIDED * math.sqrt(float(covariance[2, 2]))), 180.0)
    height_m = None if height_std_m is None else _TWO_SIDED * height_std_m
    lower_bound = keys.unseen_m > _LONG_UNSEEN_M
    return ExpectedError(end_m, 100.0 * end_m / travelled_m, heading_deg, height_m, lower_bound, keys.unseen_m)


def radius_m(covariance: FloatArray) -> float:
    """Return the radius (m) that 95 % of the errors in the plane are within; `covariance`, shape (2, 2) or larger.

    The sum of two squares of different size is taken for a scaled chi-square of the same mean and variance (Satterthwaite).
    """
    from scipy.special import gammaincinv

    sizes = np.maximum(np.linalg.eigvalsh(covariance[:2, :2]), 0.0)
    mean, variance = float(sizes.sum()), 2.0 * float((sizes**2).sum())
    if variance <= 0.0:
        return 0.0
    return math.sqrt(variance / mean * float(gammaincinv(mean**2 / variance, _SHARE)))


def _end_covariance(keys: KeyScans, closed: FloatArray | None) -> FloatArray:
    """Return the covariance (3, 3) of the last scan against the first, in its own axes."""
    first, last = keys.keys[0].pose, keys.keys[-1].pose
    end_pose = last if keys.last is None else keys.last
    step = se2.between(last, end_pose)
    if closed is None:
        end = chained(keys.keys).then(step, keys.rest)
        return end.covariance + end.jitter
    # A way that is read too long makes the whole map too large: closed loops do not tell.
    pulled_m = sum(math.hypot(key.error.pull[0], key.error.pull[1]) for key in keys.keys)
    stretched = pulled_m / max(keys.travelled_m, _SHORTEST_M) * se2.between(end_pose, first)
    stretched[2] = 0.0
    end = StepError(closed, np.zeros(3), NO_ERROR.jitter).then(step, keys.rest)
    return end.covariance + np.outer(stretched, stretched) + end.jitter
