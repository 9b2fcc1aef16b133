"""What a cycle is predicted with: speeds, rates to begin from, and stages long enough to see the next bend at any speed.

The optimiser plans a way; the speed profile says how fast it is driven, or that it ends. So the prediction never stands: what is
blocked ahead is looked for a way around.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.messages import FloatArray

_LONGEST = 5.0
_LEFT_MPS = 0.05


class Prediction(NamedTuple):
    """Rates (K,) to begin from, rad/s, speeds (K,) in the stages, and how long each takes."""

    rates: FloatArray
    speed_mps: FloatArray
    step_s: float


class Slopes(NamedTuple):
    """A way that was found: how much the joint turns for each metre (K,), at middles of stages `at_m` (K,) from its start."""

    at_m: FloatArray
    slope_rpm: FloatArray


def predicted(
    speeds: tuple[FloatArray, FloatArray], slopes: Slopes | None, left_m: float, settings: GuidanceSettings
) -> Prediction:
    """Return the prediction for speeds expected at times (both (N,), times last), along the slopes of the last plan.

    `left_m`: way to the stop, beyond which nothing is predicted.
    """
    expected, at_s = speeds
    count, creep = settings.stages, settings.creep_mps
    middles = settings.stage_s * (np.arange(count) + 0.5)
    way_m = settings.stage_s * float(np.maximum(np.interp(middles, at_s, expected), creep).sum())
    wanted_m = min(settings.reach_m, max(left_m, 1.0))
    step_s = settings.stage_s * min(max(wanted_m / way_m, 1.0), _LONGEST)
    speed = np.maximum(np.interp(step_s * (np.arange(count) + 0.5), at_s, expected), creep)
    left = max(left_m, 0.0)
    for k in range(count):
        speed[k] = min(speed[k], max(left / step_s, _LEFT_MPS))
        left = max(left - speed[k] * step_s, 0.0)
    if slopes is None:
        return Prediction(np.zeros(count), speed, step_s)
    ends = np.cumsum(speed * step_s)
    rates = np.interp(ends - 0.5 * speed * step_s, slopes.at_m, slopes.slope_rpm, right=0.0) * speed
    limit = math.radians(settings.rate_dps)
    return Prediction(np.clip(rates, -limit, limit), speed, step_s)
