"""Kinematics of both bodies for prediction: a step of Eq. (10) and (11) of the topological paper, with the lag of the joint."""

from __future__ import annotations

import math

import numba as nb

State = tuple[float, float, float, float, float]
"""x, y, heading of the leading axle, joint angle (leading less trailing heading), its rate."""


@nb.njit(cache=True, nogil=True)
def stepped(
    state: State, speed: float, rate: float, step_s: float, lead_m: float, trail_m: float, lag_s: float
) -> State:
    """Return the state after a step at constant speed and commanded rate of the joint (rad/s): exact joint, midpoint heading."""
    x, y, heading, bend, bend_rate = state
    gone = -math.expm1(-step_s / lag_s)
    after = bend + rate * step_s + (bend_rate - rate) * lag_s * gone
    middle = 0.5 * (bend + after)
    mean_rate = (after - bend) / step_s
    turn = (speed * math.sin(middle) + trail_m * mean_rate) / (lead_m * math.cos(middle) + trail_m)
    half = heading + 0.5 * step_s * turn
    way = speed * step_s
    return (
        x + way * math.cos(half),
        y + way * math.sin(half),
        heading + step_s * turn,
        after,
        bend_rate + (rate - bend_rate) * gone,
    )


@nb.njit(cache=True, nogil=True)
def trailing(state: State, lead_m: float, trail_m: float) -> tuple[float, float, float]:
    """Return x, y and heading of the trailing axle."""
    x, y, heading, bend, _ = state
    back = heading - bend
    return (
        x - lead_m * math.cos(heading) - trail_m * math.cos(back),
        y - lead_m * math.sin(heading) - trail_m * math.sin(back),
        back,
    )
