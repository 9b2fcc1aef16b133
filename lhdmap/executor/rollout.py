"""What the machine does with commands that were given: way, joint, speed; the executor's own small model of it."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray

WAY, BEND, RATE, SPEED, BRAKE = range(5)
"""Columns of a state: way driven (m, never falls), joint (rad), its rate, signed speed, brake (0 to 1)."""

Lags = tuple[float, float, float, float, float]


def lags_of(model: DriveModel) -> Lags:
    """Return lag of the joint, lag of the drive, full brake, its ramp, largest joint angle."""
    return (
        model.steering_lag_s,
        model.drive_lag_s,
        model.brake_mps2,
        model.brake_ramp_s,
        model.max_articulation_rad,
    )


@nb.njit(cache=True, nogil=True)
def rolled(state: FloatArray, given: FloatArray, lags: Lags, until_s: float, step_s: float) -> FloatArray:
    """Return states (N, 5) from now until `until_s`, the first is `state`.

    `given` (K, 4): time from which it counts (dead time included), speed, rate of the joint, brake; between two of them speed
    and rate are interpolated. The drive is fed forward, so that what is left of a speed's error dies out with its lag.
    It ends where the speed changes its sign: a path has one gear.
    """
    steps = max(int(math.ceil(until_s / step_s - 1e-9)), 0)
    out = np.empty((steps + 1, 5))
    out[0] = state
    lag, drive_lag, most, ramp, max_bend = lags
    gone, k = -math.expm1(-step_s / lag), 0
    kept = math.exp(-step_s / drive_lag)
    speed_before, _, _ = _now(given, k, 0.0)
    for i in range(steps):
        end = (i + 1) * step_s
        while k + 1 < len(given) and given[k + 1, 0] <= end:
            k += 1
        wanted, turn, braking = _now(given, k, end)
        way, bend, rate, speed, brake = out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4]
        brake += min(max(braking - brake, -step_s / ramp), step_s / ramp)
        if braking > 0.5:
            after = math.copysign(max(abs(speed) - most * brake * step_s, 0.0), speed)
        else:
            after = wanted + (speed - speed_before) * kept
        speed_before = wanted
        if after * speed < 0.0:
            return out[: i + 1]
        later = bend + turn * step_s + (rate - turn) * lag * gone
        out[i + 1, 0] = way + 0.5 * step_s * (abs(speed) + abs(after))
        out[i + 1, 1] = min(max(later, -max_bend), max_bend)
        out[i + 1, 2] = rate + (turn - rate) * gone
        out[i + 1, 3], out[i + 1, 4] = after, brake
    return out


@nb.njit(cache=True, nogil=True)
def _now(given: FloatArray, k: int, at: float) -> tuple[float, float, float]:
    """Return speed, rate and brake that count at a time; held before the first and after the last."""
    if len(given) == 0:
        return 0.0, 0.0, 0.0
    if k + 1 >= len(given) or at <= given[k, 0]:
        return given[k, 1], given[k, 2], given[k, 3]
    span = given[k + 1, 0] - given[k, 0]
    share = (at - given[k, 0]) / span if span > 0.0 else 1.0
    return (
        given[k, 1] + share * (given[k + 1, 1] - given[k, 1]),
        given[k, 2] + share * (given[k + 1, 2] - given[k, 2]),
        given[k, 3],
    )
