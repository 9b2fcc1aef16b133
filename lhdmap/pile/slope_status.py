"""The status by thresholds on the slope alone (autonomous loading, section 3.2): for Fig. 9, and for clouds without a drive.

It is not safe where the slope is the only evidence: of a bare wall or a hang-up, seen sparsely, it can read as a pile's.
"""

from __future__ import annotations

import math

from lhdmap.pile.figure9_settings import Figure9Constants

_MODEL_STD_DEG = 1.5  # rubble over the height that is seen


def status_of(inclination_deg: float, constants: Figure9Constants) -> str:
    """Return the status of an inclination."""
    steepness = abs(inclination_deg)
    if steepness < constants.shallow_deg:
        return "too_shallow"
    if steepness <= constants.steep_deg:
        return "loadable"
    return "wall" if constants.wall_deg <= steepness <= constants.overhang_deg else "hang_up"


def status_probabilities(inclination_deg: float, std_deg: float, constants: Figure9Constants) -> dict[str, float]:
    """Return the probability of each status: what a normal distribution of the steepness has of each one's range."""
    steepness, std = abs(inclination_deg), math.hypot(std_deg, _MODEL_STD_DEG)

    def below(bound_deg: float) -> float:
        return 0.5 * math.erfc((steepness - bound_deg) / (std * math.sqrt(2.0)))

    shallow, steep = below(constants.shallow_deg), below(constants.steep_deg)
    wall = below(constants.overhang_deg) - below(constants.wall_deg)
    return {"too_shallow": shallow, "loadable": steep - shallow, "wall": wall, "hang_up": 1.0 - steep - wall}
