"""Tyres on the floor, quasi-static: force / grip = 1 - exp(-k slip), slip = (wheel - ground) / the faster of both.

`grip` is friction times weight, newton. All wheels turn together.
"""

from __future__ import annotations

import math

import numba as nb

SLOW_MPS = 0.02
"""Speed below which slip is that of this speed: a ratio of two noughts is no slip."""
_ALL = 0.9999  # of the grip: what more is wanted makes the wheels lock or spin


@nb.njit(cache=True, nogil=True)
def tyre_force(wheel_mps: float, speed_mps: float, grip_n: float, stiffness: float) -> float:
    """Return the force of the floor on the machine along x, N."""
    ahead = wheel_mps - speed_mps
    slip = abs(ahead) / max(abs(wheel_mps), abs(speed_mps), SLOW_MPS)
    return math.copysign(grip_n * (1.0 - math.exp(-stiffness * slip)), ahead)


@nb.njit(cache=True, nogil=True)
def slip_for(force_n: float, grip_n: float, stiffness: float) -> float:
    """Return the slip ratio (0 to 1) at which tyres give a force: the curve's inverse; 1 where they cannot."""
    share = abs(force_n) / grip_n if grip_n > 0.0 else 1.0
    return 1.0 if share >= _ALL else min(1.0, -math.log(1.0 - share) / stiffness)


@nb.njit(cache=True, nogil=True)
def wheel_for(force_n: float, speed_mps: float, grip_n: float, stiffness: float) -> float:
    """Return the wheels' speed at which tyres give a force within the grip."""
    way = math.copysign(1.0, force_n)
    slip, along = min(slip_for(force_n, grip_n, stiffness), 0.999), speed_mps * way
    if along < 0.0:  # holding back
        return way * (along + slip * max(-along, SLOW_MPS))
    wheel = along / (1.0 - slip)
    return way * (wheel if wheel >= SLOW_MPS else min(along + slip * SLOW_MPS, SLOW_MPS))


@nb.njit(cache=True, nogil=True)
def carried_speed(
    wheel_mps: float, speed_mps: float, grip_n: float, stiffness: float, per_n: float, pull_n: float, rolling_n: float
) -> float:
    """Return the ground speed at the end of a step in which wheels turn at `wheel_mps`, m/s.

    Implicit: the tyres' force at the end of the step, since at low speed it is stiffer than a step of 1 ms can follow;
    `per_n` is the step over the mass, `pull_n` the other force along x, `rolling_n` the rolling resistance.
    Newton's rule between two bounds; the speed is unique, since all forces fall with it.
    """
    rolling_slope = rolling_n / SLOW_MPS
    low = speed_mps + per_n * (pull_n - grip_n - rolling_n)
    high = speed_mps + per_n * (pull_n + grip_n + rolling_n)
    now = min(max(speed_mps, low), high)
    for _ in range(60):
        force = tyre_force(wheel_mps, now, grip_n, stiffness)
        slope = (grip_n - abs(force)) * stiffness / max(abs(wheel_mps), abs(now), SLOW_MPS)
        resisting = min(max(now * rolling_slope, -rolling_n), rolling_n)
        miss = now - speed_mps - per_n * (force + pull_n - resisting)
        low, high = (now, high) if miss < 0.0 else (low, now)
        following = now - miss / (1.0 + per_n * (slope + (rolling_slope if abs(now) < SLOW_MPS else 0.0)))
        if not low <= following <= high:
            following = 0.5 * (low + high)
        if abs(following - now) < 1e-13:
            break
        now = following
    return now
