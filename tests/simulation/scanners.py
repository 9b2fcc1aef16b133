"""The scanners of a simulated drive, and what they see without noise."""

from __future__ import annotations

import numpy as np
from lhdmap.messages import Float32Array
from lhdmap.simulation.drive import drift_sensors
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.sensing.scans import Scanner
from lhdmap.simulation.world import DriftWorld


def scanner(world: DriftWorld, side: str = "front") -> Scanner:
    """Return the scanner on a side, `front` or `rear`."""
    return next(one for one in drift_sensors(world) if isinstance(one, Scanner) and one.name == side)


def exact(world: DriftWorld, *times_s: float, side: str = "front") -> Float32Array:
    """Return exact ranges of the scans at times after the start, shape (S, N)."""
    one = scanner(world, side)
    return np.array([one.exact_m(world.history, world, stamp(t)) for t in times_s])


def stamp(time_s: float) -> int:
    """Return the stamp at a time after the start."""
    return START_NS + round(time_s * 1e9)
