"""Is a registration good enough, and what is to be said of it."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.errors import EvaluationShortfall
from lhdmap.exports.registration import FEWEST, Registration, solve
from lhdmap.messages import FloatArray

SCALE_SHARE = 0.002
"""Beyond this, lengths of map and grid differ by more than odometry's drift explains. Assumed: 0.2 m in 100 m."""


class Misfit(EvaluationShortfall):
    """Control points that do not fit; the `registration` says by how much each."""

    def __init__(self, text: str, registration: Registration) -> None:
        super().__init__(text)
        self.registration = registration


def refuse_misfit(registration: Registration) -> None:
    """Refuse a registration that misses one of its points.

    Raises:
        Misfit: a residual or a leave-one-out error is over the tolerance; the worst point is named.
    """
    for what, misses in (("residual", registration.misses_m), ("leave-one-out error", registration.left_out_m)):
        worst = int(np.argmax(misses))
        if not misses[worst] <= registration.tolerance_m:
            raise Misfit(
                f"control point {registration.points[worst].name}: {what} {misses[worst]:.3f} m, at most "
                f"{registration.tolerance_m:g} m was wanted (RMS {registration.rms_m:.3f} m){_likely(registration)}; "
                "look at the point, or allow more with --tolerance",
                registration,
            )


def remarks(registration: Registration, reach_m: float = 0.0) -> list[str]:
    """Return warnings; `reach_m`: how far the map reaches from the middle of the control points."""
    found = []
    if abs(registration.scale - 1.0) > SCALE_SHARE:
        found.append(
            f"lengths: the grid's differ from the map's by {_per_cent(registration)} (± {100.0 * registration.scale_std:.2f}); "
            "the scale stays 1: look for drift of the map, or points in another unit or projection"
        )
    swing_m = math.radians(registration.heading_std_deg) * reach_m
    if swing_m > registration.tolerance_m:
        found.append(
            f"heading: its standard deviation of {registration.heading_std_deg:.3f} deg is {swing_m:.2f} m at the map's far end, "
            f"{reach_m:.0f} m from the control points; take points farther apart"
        )
    return found


def _likely(registration: Registration) -> str:
    """Return what looks like the cause, in words: exchanged axes, one point alone, another scale; empty where nothing does."""
    map_m = np.array([one.map_m for one in registration.points])
    grid_m = np.array([one.grid_m for one in registration.points])
    weights = np.array([one.std_m for one in registration.points]) ** -2.0
    if _worst_m(map_m, grid_m[:, [1, 0, 2]], weights) <= registration.tolerance_m:
        return "; with easting and northing exchanged they would fit"
    if len(map_m) > FEWEST:
        others = [np.arange(len(map_m)) != index for index in range(len(map_m))]
        worst_m = [_worst_m(map_m[rest], grid_m[rest], weights[rest]) for rest in others]
        best = int(np.argmin(worst_m))
        if worst_m[best] <= registration.tolerance_m:
            return f"; without {registration.points[best].name} the others fit within {worst_m[best]:.3f} m"
    if abs(registration.scale - 1.0) > max(SCALE_SHARE, 3.0 * registration.scale_std):
        return f"; lengths of the grid differ from the map's by {_per_cent(registration)}"
    return ""


def _worst_m(map_m: FloatArray, grid_m: FloatArray, weights: FloatArray) -> float:
    """Return the largest residual of points (N, 3), placed by themselves (m)."""
    return float(np.linalg.norm(solve(map_m, grid_m, weights).points(map_m) - grid_m, axis=1).max())


def _per_cent(registration: Registration) -> str:
    return f"{100.0 * (registration.scale - 1.0):+.2f} %"
