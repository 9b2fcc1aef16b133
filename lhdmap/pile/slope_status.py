"""The status by thresholds on the slope alone (autonomous loading, section 3.2): for Fig. 9, and for clouds without a drive.

It is not safe where the slope is the only evidence: of a bare wall or a hang-up, seen sparsely, it can read as a pile's.
"""

from __future__ import annotations

from lhdmap.pile.bounds import StatusBounds
from lhdmap.pile.judge import shares


def status_of(inclination_deg: float, bounds: StatusBounds) -> str:
    """Return the status of an inclination."""
    steepness = abs(inclination_deg)
    if steepness < bounds.shallow_deg:
        return "too_shallow"
    if steepness <= bounds.steep_deg:
        return "loadable"
    return "wall" if bounds.upright_deg <= steepness <= bounds.overhang_deg else "hang_up"


def status_probabilities(inclination_deg: float, std_deg: float, bounds: StatusBounds) -> dict[str, float]:
    """Return the probability of each status: what a normal distribution of the steepness has of each one's range."""
    part = shares(abs(inclination_deg), std_deg, bounds)
    return {
        "too_shallow": part.shallow,
        "loadable": part.loadable,
        "wall": part.upright,
        "hang_up": part.steep + part.overhang,
    }
