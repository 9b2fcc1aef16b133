"""The status by thresholds on the slope alone (autonomous loading, section 3.2): for Fig. 9, and for clouds without a drive.

It is not safe where the slope is the only evidence: of a bare wall or a hang-up, seen sparsely, it can read as a pile's.
"""

from __future__ import annotations

from lhdmap.pile.figure9.settings import Figure9Constants
from lhdmap.pile.judge import Bounds, shares


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
    bounds = Bounds(constants.shallow_deg, constants.steep_deg, constants.wall_deg, constants.overhang_deg)
    part = shares(abs(inclination_deg), std_deg, bounds)
    return {
        "too_shallow": part.shallow,
        "loadable": part.loadable,
        "wall": part.upright,
        "hang_up": part.steep + part.overhang,
    }
