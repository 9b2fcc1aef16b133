"""A plane through points some of which do not belong to it: least squares, weighed anew by the residuals."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

Weights = FloatArray | npt.NDArray[np.bool_]  # (N,): how much each point counts, or which count at all
Weigh = Callable[[FloatArray, Weights], Weights | None]
"""Gives new weights (N,) from residuals (N,) and the weights before; None where too few points are left."""

MAD_TO_STD = 1.4826  # standard deviation over median absolute deviation, of a normal distribution
TUKEY = 4.685  # deviations at which Tukey's weights end: 95 % efficiency for normal residuals
_LEAST_SCALE = 1e-6  # of residuals that are all zero
_RANK_SHARE = 1e-9  # of the largest singular value: below it places lie on a line


class RobustPlane(NamedTuple):
    """value = a + b u + c v: `terms` a, b, c (3,), the weights (N,) that it ends with, and whether the places determine it."""

    terms: FloatArray
    weights: Weights
    determined: bool


def robust_plane(
    places: FloatArray, values: FloatArray, weigh: Weigh, rounds: int, weights: Weights | None = None
) -> RobustPlane:
    """Return the plane of `values` (N,) over `places` (N, 2), fitted `rounds` times, from `weights` (all alike) on.

    Where `weigh` finds too few points left, the plane is the last one and all points count.
    """
    design = np.column_stack([np.ones(len(values)), places])
    weights = np.ones(len(values)) if weights is None else weights
    terms, determined = np.zeros(3), False
    for _ in range(rounds):
        if weights.dtype == np.bool_:
            rows, aims = design[weights], values[weights]
        else:
            root = np.sqrt(weights)
            rows, aims = design * root[:, None], values * root
        found, _, rank, _ = np.linalg.lstsq(rows, aims, rcond=_RANK_SHARE)
        terms, determined = found.astype(np.float64), bool(rank == 3)
        renewed = weigh(values - design @ terms, weights)
        if renewed is None:
            return RobustPlane(terms, np.ones(len(values), dtype=bool), determined)
        weights = renewed
    return RobustPlane(terms, weights, determined)


def tukey(residuals: FloatArray, _: Weights) -> FloatArray:
    """Return Tukey's weights (N,) of residuals (N,): smoothly nothing beyond 4.7 deviations of most of them."""
    spread = MAD_TO_STD * float(np.median(np.abs(residuals - np.median(residuals))))
    return np.clip(1.0 - (residuals / (TUKEY * max(spread, _LEAST_SCALE))) ** 2, 0.0, None) ** 2
