"""Which orientations φ of the breaker a position of the tip allows: the twelve candidates of Section 3.1.

At an end of the range a joint stands at a limit, so the ends are among the solutions of the inverse problem with one of θ_2, θ_3,
θ_4 at one of its two limits: six cases of a two-link arm with two solutions each. Angles φ here are in the turn around the middle
of what the joints' limits allow (Table 1: (87.3°, 447.3°]), so that no range of feasible φ wraps.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.kinematics import planar_theta, turned
from lhdmap.rockbreaker.machine import Rockbreaker

VERTICAL = math.radians(270.0)
_EDGE = 1e-7  # rad: candidates stand at a limit, where rounding must not decide


def planar_position(points_m: FloatArray) -> FloatArray:
    """Return radius and height (…, 2) of points (…, 3)."""
    return np.stack([np.hypot(points_m[..., 0], points_m[..., 1]), points_m[..., 2]], axis=-1)


def candidates(machine: Rockbreaker, planar_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return φ (…, 12) and the joints θ_2 … θ_4 (…, 12, 3) with one joint at a limit, NaN where there is none or not feasible.

    `planar_m` (…, 2): radius and height of the tip.
    """
    along = planar_m[..., 0] - machine.links_m[0]
    up = planar_m[..., 1] - machine.base.height_m
    solutions = []
    for limits in machine.theta_limits:
        for solve in (_boom_at, _arm_at, _breaker_at):
            solutions += [solve(machine, along, up, limits, sign) for sign in (-1.0, 1.0)]
    theta = turned(np.stack(solutions, axis=-2), machine.theta_limits[:, 1:].mean(axis=0))
    low, high = machine.theta_limits[:, 1:]
    feasible = np.all((theta >= low - _EDGE) & (theta <= high + _EDGE), axis=-1, keepdims=True)
    theta = np.where(feasible, theta, np.nan)
    return unwrapped(machine, theta.sum(axis=-1) - math.radians(machine.base.breaker_offset_deg)), theta


def unwrapped(machine: Rockbreaker, phi: FloatArray) -> FloatArray:
    """Return angles φ in the turn around the middle of those that the joints' limits allow."""
    middle = float(machine.theta_limits[:, 1:].mean(axis=0).sum()) - math.radians(machine.base.breaker_offset_deg)
    return turned(phi, float(turned(np.asarray(middle), VERTICAL)))


def holds_vertical(low: FloatArray, high: FloatArray) -> npt.NDArray[np.bool_]:
    """Return whether the ranges from `low` to `high` (…) hold a vertical breaker, in whatever turn; NaN: not."""
    turn = 2.0 * np.pi
    return np.asarray(np.ceil((low - VERTICAL) / turn) <= np.floor((high - VERTICAL) / turn))


def _two_link(
    along: FloatArray, up: FloatArray, first: float, second: float, sign: float
) -> tuple[FloatArray, FloatArray]:
    """Return direction of the first link and bend at the second of a two-link arm that reaches (along, up); NaN: out of reach."""
    cosine = (along**2 + up**2 - first**2 - second**2) / (2.0 * first * second)
    bend = sign * np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
    return np.arctan2(up, along) - np.arctan2(second * np.sin(bend), first + second * np.cos(bend)), bend


def _boom_at(machine: Rockbreaker, along: FloatArray, up: FloatArray, limits: FloatArray, sign: float) -> FloatArray:
    """Return θ_2 … θ_4 with θ_2 at its limit: outer boom and breaker reach the tip."""
    _, a2, a3, a4 = machine.links_m
    theta2 = limits[1]
    direction, bend = _two_link(along - a2 * math.cos(theta2), up - a2 * math.sin(theta2), a3, a4, sign)
    return np.stack([np.full_like(bend, theta2), direction - theta2, bend], axis=-1)


def _arm_at(machine: Rockbreaker, along: FloatArray, up: FloatArray, limits: FloatArray, sign: float) -> FloatArray:
    """Return θ_2 … θ_4 with θ_3 at its limit: both booms are one link."""
    _, a2, a3, a4 = machine.links_m
    joined = a2 + a3 * complex(math.cos(limits[2]), math.sin(limits[2]))
    lean = math.atan2(joined.imag, joined.real)
    direction, bend = _two_link(along, up, abs(joined), a4, sign)
    return np.stack([direction - lean, np.full_like(bend, limits[2]), bend + lean - limits[2]], axis=-1)


def _breaker_at(machine: Rockbreaker, along: FloatArray, up: FloatArray, limits: FloatArray, sign: float) -> FloatArray:
    """Return θ_2 … θ_4 with θ_4 at its limit: outer boom and breaker are one link."""
    _, a2, a3, a4 = machine.links_m
    joined = a3 + a4 * complex(math.cos(limits[3]), math.sin(limits[3]))
    lean = math.atan2(joined.imag, joined.real)
    direction, bend = _two_link(along, up, a2, abs(joined), sign)
    return np.stack([direction, bend - lean, np.full_like(bend, limits[3])], axis=-1)


def phi_range(machine: Rockbreaker, planar_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return φ_min and φ_max (…) of tips with radius and height (…, 2), step 5 of Section 3.1; NaN: out of reach."""
    phi, _ = candidates(machine, planar_m)
    none = np.isnan(phi).all(axis=-1)
    low = np.min(np.where(np.isnan(phi), np.inf, phi), axis=-1)
    high = np.max(np.where(np.isnan(phi), -np.inf, phi), axis=-1)
    return np.where(none, np.nan, low), np.where(none, np.nan, high)


def phi_intervals(machine: Rockbreaker, planar_m: FloatArray) -> FloatArray:
    """Return the intervals of feasible φ (…, 12, 2) of tips (…, 2) in rising order, NaN where there are fewer.

    Section 3.1 takes the whole range between φ_min and φ_max for feasible. In one of forty positions of the workspace of Table 1
    it has a gap, which the arm cannot cross; so the middle between neighbouring candidates is tried.
    """
    ends = np.sort(candidates(machine, planar_m)[0], axis=-1)
    middles = 0.5 * (ends[..., :-1] + ends[..., 1:])
    places = np.broadcast_to(planar_m[..., None, :], (*middles.shape, 2))
    theta = planar_theta(machine, np.concatenate([places, middles[..., None]], axis=-1))
    low, high = machine.theta_limits[:, 1:]
    passable = np.all((theta >= low - _EDGE) & (theta <= high + _EDGE), axis=-1)
    starts = np.concatenate([np.ones_like(passable[..., :1]), ~passable], axis=-1) & ~np.isnan(ends)
    stops = np.concatenate([~passable, np.ones_like(passable[..., :1])], axis=-1) & ~np.isnan(ends)
    pairs = np.stack([np.where(starts, ends, np.nan), np.where(stops, ends, np.nan)], axis=-1)
    return np.sort(pairs, axis=-2)


def nearest_vertical(machine: Rockbreaker, point_m: FloatArray) -> float:
    """Return the φ of Section 3.1 for one tip (3,): vertical, or as near to it as the limits allow; NaN: not to be reached."""
    intervals = phi_intervals(machine, planar_position(point_m))
    intervals = intervals[~np.isnan(intervals[:, 0])]
    swing = math.atan2(point_m[1], point_m[0])
    if not len(intervals) or not machine.theta_limits[0, 0] <= swing <= machine.theta_limits[1, 0]:
        return math.nan
    vertical = VERTICAL + 2.0 * np.pi * np.array([[0.0], [-1.0], [1.0]])
    nearest = np.clip(vertical, intervals[:, 0], intervals[:, 1])
    return float(nearest.flat[np.argmin(np.abs(nearest - vertical))])
