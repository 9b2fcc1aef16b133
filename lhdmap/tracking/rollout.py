"""The closed loop, predicted from where a command counts: what goes to the executor's queue."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.tracking.path import STEP_M

STAGE_S, STAGES = 0.1, 45
END_S = 0.7
"""The last way is gone with this time constant."""
_LOOK_S = 0.4


class Start(NamedTuple):
    """Errors (4,), where on the curve (m), way to its end (m), speed of the rear axle without its sign (m/s), joint angle."""

    x: FloatArray
    along_m: float
    left_m: float
    speed_mps: float
    bend_rad: float


class Loop(NamedTuple):
    """Gain (4,), A (4, 4), B (4,) of the reduced state at this speed; gear, lengths and lag, forward share of the curve."""

    gain: FloatArray
    a: FloatArray
    b: FloatArray
    gear: int
    lengths: tuple[float, float, float]
    feed: float


class Bounds(NamedTuple):
    """Largest offset that counts (m), speed below which the joint slows (m/s), speeding up, braking (m/s2), rate (rad/s).

    `ceiling_mps`: speed that is gone down to by `slow_mps2`. The joint is held within an acceleration (m/s2) and an angle (rad).
    """

    clip_m: float
    slow_mps: float
    accelerate_mps2: float
    brake_mps2: float
    rate_rps: float
    ceiling_mps: float
    slow_mps2: float
    lateral_mps2: float
    bend_rad: float


@nb.njit(cache=True, nogil=True)
def rolled(rows: FloatArray, caps: FloatArray, start: Start, loop: Loop, bounds: Bounds) -> FloatArray:
    """Return (K + 1, 3) each 0.1 s: speed of the front axle, commanded rate of the joint, speed of the rear axle."""
    out = np.zeros((STAGES + 1, 3))
    x, change = start.x.copy(), np.zeros(4)
    along, left, bend, gear = start.along_m, start.left_m, start.bend_rad, loop.gear
    front_m, rear_m, lag_s = loop.lengths
    speed = min(start.speed_mps, speed_at(caps, along, left, bounds.brake_mps2))
    for k in range(STAGES + 1):
        rear = gear * speed
        # the joint's lag is led, by the way that is gone in it
        forward = loop.feed * rear * _between(rows, along + rear * lag_s)
        asked = loop.gain[0] * min(max(x[0], -bounds.clip_m), bounds.clip_m)
        for i in range(1, 4):
            asked += loop.gain[i] * x[i]
        rate = forward - min(speed / bounds.slow_mps, 1.0) * asked
        # the joint stays within its stop, and within what the machine stands at this speed
        bent = min(bounds.bend_rad, bounds.lateral_mps2 * (front_m + rear_m) / max(speed * speed, 0.1))
        rate = min(max(rate, (-bent - bend) / _LOOK_S), (bent - bend) / _LOOK_S)
        rate = min(max(rate, -bounds.rate_rps), bounds.rate_rps)
        apart = front_m + rear_m * math.cos(bend)
        front = ((rear_m + front_m * math.cos(bend)) * rear - front_m * rear_m * math.sin(bend) * rate) / apart
        out[k, 0], out[k, 1], out[k, 2] = front, rate, rear
        for _ in range(2):
            for i in range(4):
                change[i] = loop.b[i] * (rate - forward)
                for j in range(4):
                    change[i] += loop.a[i, j] * x[j]
            for i in range(4):
                x[i] += 0.5 * STAGE_S * change[i]
        bend += rate * STAGE_S
        along, left = along + rear * STAGE_S, left - speed * STAGE_S
        held = max(bounds.ceiling_mps, speed - bounds.slow_mps2 * STAGE_S)
        speed = min(speed + bounds.accelerate_mps2 * STAGE_S, held, speed_at(caps, along, left, bounds.brake_mps2))
    return out


@nb.njit(cache=True, nogil=True)
def speed_at(caps: FloatArray, along_m: float, left_m: float, brake_mps2: float) -> float:
    """Return the highest speed at a length of the curve, so far before the stop."""
    on = min(max(along_m / STEP_M, 0.0), len(caps) - 1.0)
    k = min(int(on), len(caps) - 2)
    cap = caps[k] + (on - k) * (caps[k + 1] - caps[k])
    left = max(left_m, 0.0)
    return min(cap, math.sqrt(2.0 * brake_mps2 * left), left / END_S)


@nb.njit(cache=True, nogil=True)
def _between(rows: FloatArray, along_m: float) -> float:
    """Return dβ/ds at a length of the curve."""
    on = min(max(along_m / STEP_M, 0.0), len(rows) - 1.0)
    k = min(int(on), len(rows) - 2)
    return rows[k, 5] + (on - k) * (rows[k + 1, 5] - rows[k, 5])
