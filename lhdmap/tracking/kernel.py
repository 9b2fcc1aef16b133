"""The machine by its rear axle, with slip at both axles: Eq. (3) of the load-haul-dump paper, corrected, in steps."""

from __future__ import annotations

import math

import numba as nb

State = tuple[float, float, float, float, float]
"""x, y, heading of the REAR axle, joint angle (front less rear heading, positive left), its rate; m, rad, rad/s."""
Lengths = tuple[float, float, float]
"""Joint to front axle L0, joint to rear axle L1 (m), lag of the joint's rate (s)."""
Slips = tuple[float, float]
"""Angles from the heading of the front and of the rear body to the course of its axle, rad, positive left."""


@nb.njit(cache=True, nogil=True)
def moved(state: State, rear_mps: float, rate_rps: float, step_s: float, lengths: Lengths, slips: Slips) -> State:
    """Return the state after a step at constant speed of the rear axle and commanded rate: exact joint, midpoint heading."""
    x, y, heading, bend, bend_rate = state
    front_m, rear_m, lag_s = lengths
    gone = -math.expm1(-step_s / lag_s)
    after = bend + rate_rps * step_s + (bend_rate - rate_rps) * lag_s * gone
    middle, mean_rate = 0.5 * (bend + after), (after - bend) / step_s
    # both axles move along their course: the joint between them has one velocity
    across = front_m * math.cos(slips[0])
    turn = (rear_mps * math.sin(middle + slips[0] - slips[1]) - across * mean_rate) / (
        across + rear_m * math.cos(middle + slips[0])
    )
    course = heading + 0.5 * step_s * turn + slips[1]
    return (
        x + rear_mps * step_s * math.cos(course),
        y + rear_mps * step_s * math.sin(course),
        heading + step_s * turn,
        after,
        bend_rate + (rate_rps - bend_rate) * gone,
    )


def front_axle(state: State, lengths: Lengths) -> tuple[float, float, float]:
    """Return x, y and heading of the front axle (`base_link`): Eqs. (4), sign corrected, to (6)."""
    x, y, heading, bend, _ = state
    ahead = heading + bend
    return (
        x + lengths[1] * math.cos(heading) + lengths[0] * math.cos(ahead),
        y + lengths[1] * math.sin(heading) + lengths[0] * math.sin(ahead),
        ahead,
    )


def rear_speed(front_mps: float, bend: float, rate: float, lengths: Lengths) -> float:
    """Return v1 of v0: v0 = (E v1 - L0 L1 sin β ω) / D."""
    front_m, rear_m, _ = lengths
    apart = front_m + rear_m * math.cos(bend)
    return (front_mps * apart + front_m * rear_m * math.sin(bend) * rate) / (rear_m + front_m * math.cos(bend))


def front_speed(rear_mps: float, bend: float, rate: float, lengths: Lengths) -> float:
    """Return v0 of v1."""
    front_m, rear_m, _ = lengths
    apart = front_m + rear_m * math.cos(bend)
    return ((rear_m + front_m * math.cos(bend)) * rear_mps - front_m * rear_m * math.sin(bend) * rate) / apart
