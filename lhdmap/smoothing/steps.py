"""Covariances of the steps from key to key: what was measured, and what no drive is better than."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.settings import SmoothingSettings

_SHORTEST_M, _PER_TURN = 0.1, 0.002
# Deviations of a step beyond which it ties nothing: a heading of more turns round, and marginals would have no digits left.
_LOOSEST = np.array([3.0, 3.0, 0.5])


def step_covariances(keys: list[KeyScan], settings: SmoothingSettings) -> list[FloatArray]:
    """Return the covariances (3, 3) of the steps from key to key, each in the axes of its end."""
    return [step_covariance(before, after, settings) for before, after in pairwise(keys)]


def step_covariance(before: KeyScan, after: KeyScan, settings: SmoothingSettings) -> FloatArray:
    """Return the covariance (3, 3) of a step: what was measured, and what no drive is better than."""
    travel_m = max(after.travelled_m - before.travelled_m, _SHORTEST_M)
    turn = abs(float(se2.wrap(after.pose[2] - before.pose[2])))
    position = settings.along_sigma * math.sqrt(travel_m)
    heading = math.radians(settings.heading_sigma_deg) * math.sqrt(travel_m) + _PER_TURN * turn
    covariance = after.error.covariance + np.diag([position**2, position**2, heading**2])
    share = np.minimum(1.0, _LOOSEST / np.sqrt(np.diag(covariance)))
    bounded: FloatArray = covariance * np.outer(share, share)
    return bounded
