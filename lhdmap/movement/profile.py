"""When the machine is where on a route: the quickest speeds that limits, accelerations and stops allow."""

from __future__ import annotations

import math
from itertools import pairwise

from lhdmap.movement.costs import Pace


def run_times(
    lengths_m: list[float], speeds_mps: list[float], pace: Pace, caps_mps: list[float] | None = None
) -> list[float]:
    """Return the times (s) for the n pieces of a run from a stop to the next, with a highest speed on each piece.

    The speed between two pieces is the highest one that can be gathered from the start, lost before the end, and is allowed on
    both, and at the point there (`caps_mps`, n - 1). A piece too short for its highest speed has a peak in the middle (a
    triangle over time).
    """
    caps = [math.inf] * (len(lengths_m) - 1) if caps_mps is None else caps_mps
    between = [0.0, *(min(a, b, cap) for (a, b), cap in zip(pairwise(speeds_mps), caps, strict=True)), 0.0]
    for k, length in enumerate(lengths_m):
        between[k + 1] = min(between[k + 1], math.sqrt(between[k] ** 2 + 2.0 * pace.acceleration_mps2 * length))
    for k in range(len(lengths_m) - 1, -1, -1):
        between[k] = min(between[k], math.sqrt(between[k + 1] ** 2 + 2.0 * pace.deceleration_mps2 * lengths_m[k]))
    return [
        piece_time(length, speed, between[k], between[k + 1], pace)
        for k, (length, speed) in enumerate(zip(lengths_m, speeds_mps, strict=True))
    ]


def piece_time(length_m: float, speed_mps: float, from_mps: float, to_mps: float, pace: Pace) -> float:
    """Return the time (s) for a piece that begins and ends with given speeds, at `speed_mps` where there is room for it."""
    if length_m <= 0.0:
        return 0.0
    a, d = pace.acceleration_mps2, pace.deceleration_mps2
    reached = math.sqrt((2.0 * a * d * length_m + d * from_mps**2 + a * to_mps**2) / (a + d))
    peak = min(speed_mps, reached)
    rest_m = length_m - (peak**2 - from_mps**2) / (2.0 * a) - (peak**2 - to_mps**2) / (2.0 * d)
    return (peak - from_mps) / a + (peak - to_mps) / d + max(rest_m, 0.0) / peak
