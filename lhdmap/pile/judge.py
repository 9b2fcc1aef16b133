"""The status with its probabilities.

The inclination is a normal distribution with its deviation; each status owns a range of it, and what the distribution has of
the range is its probability. A surface as steep as a wall is one where it is smooth and upright and a hang-up where it is rough
or bent; what does not close the drift from wall to wall, or was hardly seen, gives its probability to `none`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.pile.bounds import BOUNDS, StatusBounds
from lhdmap.pile.result import STATUSES

_MODEL_STD_DEG = 1.5  # rubble over the height that is seen
_ROCK_M, _RUBBLE_M = 0.026, 0.033  # grain of bare rock and of rubble, measured in simulated scenes
_STEEP = ("hang_up", "wall")
FLOOR_DEG = 8.0  # flatter is floor that rises


class Shares(NamedTuple):
    """What a normal distribution of the steepness has of each range; they add up to 1."""

    shallow: float
    loadable: float
    steep: float
    upright: float
    overhang: float


def shares(steepness_deg: float, std_deg: float, bounds: StatusBounds = BOUNDS) -> Shares:
    """Return the share of each range; rubble over the height that is seen adds to the standard deviation."""
    a, b, c, d = (_below(bound, steepness_deg, std_deg) for bound in bounds)
    return Shares(a, b - a, c - b, d - c, 1.0 - d)


def _below(bound_deg: float, steepness_deg: float, std_deg: float) -> float:
    std = math.hypot(std_deg, _MODEL_STD_DEG)
    return 0.5 * math.erfc((steepness_deg - bound_deg) / (std * math.sqrt(2.0)))


class StatusEvidence(NamedTuple):
    """What the status follows from.

    Inclination and deviation (deg, sign of Table 6), grain (m): how unlike neighbouring decimetres are, share of the width that
    the face covers, share of it on which hits lie beyond the face, length before the face on which a wall is missing (m),
    deviation of the fit alone (deg): how little of a plane it is.
    """

    inclination_deg: float
    std_deg: float
    grain_m: float
    covered: float
    beyond: float
    gap_m: float
    fit_std_deg: float = 0.0


def probabilities(evidence: StatusEvidence) -> dict[str, float]:
    """Return the probability of each status."""
    angle = -evidence.inclination_deg
    part = shares(angle, evidence.std_deg)
    rough = _ramp(evidence.grain_m, _ROCK_M, _RUBBLE_M)
    share = {
        "too_shallow": max(part.shallow - _below(FLOOR_DEG, angle, evidence.std_deg), 0.0),
        "loadable": part.loadable,
        "hang_up": part.steep + part.overhang + part.upright * rough,
        "wall": part.upright * (1.0 - rough),
    }
    closes = _ramp(evidence.covered, 0.4, 0.7) * (1.0 - _ramp(evidence.beyond, 0.1, 0.3))
    # the outer wall of a bend: on the inner side the drift goes on, and it is curved besides and fits no plane
    bend = 1.0 - (1.0 - _ramp(evidence.gap_m, 1.2, 2.5)) * (1.0 - _ramp(evidence.fit_std_deg, 4.5, 7.0))
    steep = closes * (1.0 - bend)
    result = {name: share.get(name, 0.0) * (steep if name in _STEEP else closes) for name in STATUSES}
    result["none"] = max(1.0 - sum(result.values()), 0.0)
    return result


def _ramp(value: float, low: float, high: float) -> float:
    return min(max((value - low) / (high - low), 0.0), 1.0)
