"""What a swinging pressure swings about: the mean of a window, or a damped sinusoid fitted to it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

_FREQUENCIES_HZ = np.geomspace(0.7, 6.0, 28)
_DAMPING = (0.02, 0.05, 0.09, 0.15)


class Settled(NamedTuple):
    """A pressure at rest, its deviation, and that of the samples from what was fitted, bar."""

    pressure_bar: float
    std_bar: float
    residual_bar: float


def mean_of(pressure_bar: FloatArray) -> Settled:
    """Return the mean of samples (N,); a swing of a part of a period is an error that it does not know of."""
    scatter = float(pressure_bar.std())
    return Settled(float(pressure_bar.mean()), scatter / math.sqrt(len(pressure_bar)), scatter)


def sinusoid_of(time_s: FloatArray, pressure_bar: FloatArray) -> Settled:
    """Return the centre of `p = c + e^(-z w t) (a cos w t + b sin w t)` through samples (N,): least squares over a grid of w, z.

    Linear in c, a, b for each frequency (0.7 to 6 Hz) and damping (2 to 15 %): no starting value, no iteration.
    """
    t = time_s - time_s[0]
    best: tuple[float, float, float] | None = None
    for frequency_hz in _FREQUENCIES_HZ:
        w = 2.0 * math.pi * frequency_hz
        for damping in _DAMPING:
            swing = np.exp(-damping * w * t)
            columns = np.stack([np.ones_like(t), swing * np.cos(w * t), swing * np.sin(w * t)], axis=1)
            normal = columns.T @ columns
            found = np.linalg.solve(normal + 1e-9 * np.eye(3), columns.T @ pressure_bar)
            error = float(((pressure_bar - columns @ found) ** 2).sum())
            if best is None or error < best[0]:
                best = error, float(found[0]), float(np.linalg.inv(normal + 1e-9 * np.eye(3))[0, 0])
    if best is None:
        raise AssertionError("the grid is not empty")
    error, centre, spread = best
    variance = error / max(len(t) - 5, 1)
    return Settled(centre, math.sqrt(variance * spread), math.sqrt(variance))
