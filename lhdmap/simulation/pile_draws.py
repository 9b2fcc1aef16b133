"""Values at chance, as a scenario file shows them: rounded to the fourth digit."""

from __future__ import annotations

import numpy as np


def tilt_error(rng: np.random.Generator, chance: float, spread_deg: float) -> float:
    """Return an error of the scanner's tilt (deg): with a chance a normal one, at most three spreads; otherwise none."""
    error = float(np.clip(rng.normal(0.0, spread_deg), -3 * spread_deg, 3 * spread_deg))
    return rounded(error) if rng.random() < chance else 0.0


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a value from `low` to `high`, all alike."""
    return rounded(rng.uniform(low, high))


def normal(rng: np.random.Generator, spread: float) -> float:
    """Return a normal value of mean zero."""
    return rounded(rng.normal(0.0, spread))


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a value whose size is from `low` to `high`, with either sign."""
    return rounded(float(rng.choice([-1.0, 1.0])) * rng.uniform(low, high))


def rounded(value: float) -> float:
    """Return a value as a scenario file shows it: to a tenth of a millimetre, or of a thousandth of a degree."""
    return round(float(value), 4)
