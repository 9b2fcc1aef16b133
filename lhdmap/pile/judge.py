"""The status with its probabilities.

The inclination is a normal distribution with its deviation; each status owns a range of it, and what the distribution has of
the range is its probability. A surface as steep as a wall is one where it is smooth and upright and a hang-up where it is rough
or bent; what does not close the drift from wall to wall, or was hardly seen, gives its probability to `none`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.pile.result import STATUSES

# bounds of |inclination| in degrees: findings, section 1
SHALLOW_DEG, STEEP_DEG, UPRIGHT_DEG, OVERHANG_DEG = 28.0, 60.0, 81.0, 98.0
_MODEL_STD_DEG = 1.5  # rubble over the height that is seen
_SMOOTH_M = 0.075  # spread of bare rock, unless the drift's own walls are rougher: then theirs, and so much more
_ROUGHER = 1.2
FLOOR_DEG = 8.0  # flatter is floor that rises


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
    std = math.hypot(evidence.std_deg, _MODEL_STD_DEG)

    def below(bound_deg: float) -> float:
        return 0.5 * math.erfc((angle - bound_deg) / (std * math.sqrt(2.0)))

    usual = max(_SMOOTH_M, _ROUGHER * evidence.walls_m)
    rough = _ramp(evidence.spread_m, usual, 1.25 * usual)
    upright = below(OVERHANG_DEG) - below(UPRIGHT_DEG)
    share = {
        "too_shallow": below(SHALLOW_DEG),
        "loadable": below(STEEP_DEG) - below(SHALLOW_DEG),
        "hang_up": below(UPRIGHT_DEG) - below(STEEP_DEG) + 1.0 - below(OVERHANG_DEG) + upright * rough,
        "wall": upright * (1.0 - rough),
    }
    closes = _ramp(evidence.covered, 0.4, 0.7) * (1.0 - _ramp(evidence.beyond, 0.1, 0.3))
    if angle > STEEP_DEG:  # the outer wall of a bend: on the inner side the drift goes on
        closes *= 1.0 - _ramp(evidence.gap_m, 1.2, 2.5)
        closes *= 1.0 - _ramp(evidence.std_deg, 4.5, 7.0)  # ... is curved besides, and fits no plane
    if angle < FLOOR_DEG:
        closes = 0.0
    result = {name: share.get(name, 0.0) * closes for name in STATUSES}
    result["none"] = max(1.0 - sum(result.values()), 0.0)
    return result


def _ramp(value: float, low: float, high: float) -> float:
    return min(max((value - low) / (high - low), 0.0), 1.0)
