"""The bounds of steepness between the statuses of a pile, for all methods."""

from __future__ import annotations

from typing import NamedTuple


class StatusBounds(NamedTuple):
    """Bounds of the steepness in degrees between too shallow, loadable, steep, upright and overhanging."""

    shallow_deg: float
    steep_deg: float
    upright_deg: float
    overhang_deg: float


BOUNDS = StatusBounds(28.0, 60.0, 81.0, 98.0)  # measured in simulated scenes; section 3.2 gives none
