"""The status with its probabilities.

The inclination is a normal distribution with its deviation; each status owns a range of it, and what the distribution has of
the range is its probability. A surface as steep as a wall is one where it is smooth and upright and a hang-up where it is rough
or bent; what does not close the drift from wall to wall, or was hardly seen, gives its probability to `none`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.pile.result import STATUSES

_MODEL_STD_DEG = 1.5  # rubble over the height that is seen
_SMOOTH_M = 0.075  # spread of bare rock, unless the drift's own walls are rougher: then theirs, and so much more
_ROUGHER = 1.2
FLOOR_DEG = 8.0  # flatter is floor that rises


class Bounds(NamedTuple):
    """Bounds of the steepness in degrees between too shallow, loadable, steep, upright and overhanging."""

    shallow_deg: float = 28.0
    steep_deg: float = 60.0
    upright_deg: float = 81.0
    overhang_deg: float = 98.0


BOUNDS = Bounds()  # measured in simulated scenes


class Shares(NamedTuple):
    """What a normal distribution of the steepness has of each range; they add up to 1."""

    shallow: float
    loadable: float
    steep: float
    upright: float
    overhang: float


def shares(steepness_deg: float, std_deg: float, bounds: Bounds = BOUNDS) -> Shares:
    """Return the share of each range; rubble over the height that is seen adds to the standard deviation."""
    std = math.hypot(std_deg, _MODEL_STD_DEG)
    a, b, c, d = (0.5 * math.erfc((steepness_deg - bound) / (std * math.sqrt(2.0))) for bound in bounds)
    return Shares(a, b - a, c - b, d - c, 1.0 - d)


class Evidence(NamedTuple):
    """What the status follows from.

    Inclination and deviation (deg, sign of Table 6), spread of the residuals along the normal (m), share of the width that the
    face covers, share of it on which hits lie beyond the face, length before the face on which a wall is missing (m), spread of
    the side walls (m).
    """

    inclination_deg: float
    std_deg: float
    spread_m: float
    covered: float
    beyond: float
    gap_m: float
    walls_m: float = 0.0


def probabilities(evidence: Evidence) -> dict[str, float]:
    """Return the probability of each status."""
    angle = -evidence.inclination_deg
    part = shares(angle, evidence.std_deg)
    usual = max(_SMOOTH_M, _ROUGHER * evidence.walls_m)
    rough = _ramp(evidence.spread_m, usual, 1.25 * usual)
    share = {
        "too_shallow": part.shallow,
        "loadable": part.loadable,
        "hang_up": part.steep + part.overhang + part.upright * rough,
        "wall": part.upright * (1.0 - rough),
    }
    closes = _ramp(evidence.covered, 0.4, 0.7) * (1.0 - _ramp(evidence.beyond, 0.1, 0.3))
    if angle > BOUNDS.steep_deg:  # the outer wall of a bend: on the inner side the drift goes on
        closes *= 1.0 - _ramp(evidence.gap_m, 1.2, 2.5)
        closes *= 1.0 - _ramp(evidence.std_deg, 4.5, 7.0)  # ... is curved besides, and fits no plane
    if angle < FLOOR_DEG:
        closes = 0.0
    result = {name: share.get(name, 0.0) * closes for name in STATUSES}
    result["none"] = max(1.0 - sum(result.values()), 0.0)
    return result


def _ramp(value: float, low: float, high: float) -> float:
    return min(max((value - low) / (high - low), 0.0), 1.0)
