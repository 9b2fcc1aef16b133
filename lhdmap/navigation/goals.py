"""When a target is reached, and when it was missed: Eqs. (2) to (6) of the topological paper."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.navigation.settings import NavigationSettings


class Approach(NamedTuple):
    """How the machine stands to a target: offset (2,) to it, covariance (2, 2), speed towards it (m/s), heading off it (rad)."""

    offset_m: FloatArray
    covariance: FloatArray
    closing_mps: float
    heading_rad: float


def likelihood_pm2(approach: Approach, least_std_m: float) -> float:
    """Return the density of being at the target, 1/m²: Eq. (2), the deviation at least `least_std_m`."""
    sigma = approach.covariance + least_std_m**2 * np.eye(2)
    gone = float(approach.offset_m @ np.linalg.solve(sigma, approach.offset_m))
    return math.exp(-0.5 * gone) / (2.0 * math.pi * math.sqrt(float(np.linalg.det(sigma))))


def reached(approach: Approach, settings: NavigationSettings, *, crossing: bool) -> bool:
    """Return whether a target is reached: Eq. (2) in a tunnel, Eqs. (2), (3) and (4) in an intersection."""
    if likelihood_pm2(approach, settings.reached_std_m) <= settings.reached_likelihood_pm2:
        return False
    if not crossing:
        return True
    turned = abs(math.remainder(approach.heading_rad, 2.0 * math.pi))
    return approach.closing_mps > settings.approach_mps and turned < math.radians(settings.heading_deg)


def overrun(driven_m: float, length_m: float, settings: NavigationSettings) -> bool:
    """Return whether a tunnel's end was missed: Eqs. (5) and (6), both."""
    return driven_m - length_m > settings.overrun_m and driven_m > settings.overrun_share * length_m
