"""What a stage costs, with gradient and Hessian in the leading axle's (x, y, θ, γ) (numba).

J = Σ_k Σ_p w1 max(0, d1 - d)² + w2 max(0, d2 - d)²          clearance d of each outline point p, less the field's error
  + Σ_k f(s) (wy e_y² + wψ e_ψ²)                              off the route, five times at the end
  + Σ_k wdu (u_k - u_{k-1})² + wu u_k² + wg max(0, |γ| - γ1)²  smooth, small, within the joint's limits
(guidance findings, section 2; the terms in u are the solver's.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.guidance.field import Field, clearance
from lhdmap.guidance.outline import Outline
from lhdmap.messages import FloatArray

_JOINT_WEIGHT = 200.0
_JOINT_RESERVE = math.radians(2.0)
_BEHIND, _AHEAD = 8, 40  # points of the path that are searched about the last nearest one

Index = npt.NDArray[np.int32]


class Vehicle(NamedTuple):
    """Lengths from the joint to the leading and the trailing axle, the lag of its rate, its limit."""

    lead_m: float
    trail_m: float
    lag_s: float
    max_bend_rad: float


class Weights(NamedTuple):
    """The weights of J, SI and radians; `points`: by which the clearance of each outline point counts."""

    near_m: float
    near: float
    close_m: float
    close: float
    error_m: float
    lateral: float
    heading: float
    end: float
    change: float
    rate: float
    points: float


class Stage(NamedTuple):
    """A stage's cost, half its gradient (4,) and Hessian (4, 4), its least clearance, and its point of the path."""

    cost: float
    b: FloatArray
    A: FloatArray
    clearance_m: float
    at: int


class Expansion(NamedTuple):
    """The cost of a horizon over its K rates, half its gradient and Hessian; least clearances and points of the path (K + 1,)."""

    cost: float
    H: FloatArray
    g: FloatArray
    clearance_m: FloatArray
    at: Index


@nb.njit(cache=True, nogil=True)
def stage_cost(
    state: FloatArray,
    path: FloatArray,
    about: int,
    share: float,
    vehicle: Vehicle,
    weights: Weights,
    outline: Outline,
    field: Field,
) -> Stage:
    """Return what a state (5,) costs; `about`: the path's point before, `share`: by how much the route counts here."""
    A, b = np.zeros((4, 4)), np.zeros(4)
    at = nearest_on(path, state[0], state[1], about)
    cost, least = _clearances(A, b, state, vehicle, weights, outline, field)
    cost += _route(A, b, state, path, at, weights, share)
    cost += _joint(A, b, state[3], vehicle.max_bend_rad)
    return Stage(cost, b, A, least, at)


@nb.njit(cache=True, nogil=True)
def _clearances(
    A: FloatArray,
    b: FloatArray,
    state: FloatArray,
    vehicle: Vehicle,
    weights: Weights,
    outline: Outline,
    field: Field,
) -> tuple[float, float]:
    """Add the clearances of both bodies; return their cost and the least of them."""
    x, y, heading = state[0], state[1], state[2]
    back = heading - state[3]
    jx, jy = x - vehicle.lead_m * math.cos(heading), y - vehicle.lead_m * math.sin(heading)
    tx, ty = jx - vehicle.trail_m * math.cos(back), jy - vehicle.trail_m * math.sin(back)
    leading = _body(A, b, (x, y, heading), (x, y), (jx, jy), False, weights, outline.leading, field)
    trailing = _body(A, b, (tx, ty, back), (x, y), (jx, jy), True, weights, outline.trailing, field)
    return leading[0] + trailing[0], min(leading[1], trailing[1])


@nb.njit(cache=True, nogil=True)
def _body(
    A: FloatArray,
    b: FloatArray,
    pose: tuple[float, float, float],
    lead: tuple[float, float],
    joint: tuple[float, float],
    trails: bool,
    weights: Weights,
    points: FloatArray,
    field: Field,
) -> tuple[float, float]:
    """Add the clearances of a body at a pose; it turns about the leading axle with θ, about the joint with -γ where it trails."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    cost, least = 0.0, math.inf
    row = np.zeros(4)
    for n in range(len(points)):
        px, py = pose[0] + c * points[n, 0] - s * points[n, 1], pose[1] + s * points[n, 0] + c * points[n, 1]
        ax, ay = pose[0] + c * points[n, 2] - s * points[n, 3], pose[1] + s * points[n, 2] + c * points[n, 3]
        d, nx, ny = clearance(px, py, ax, ay, field)
        d -= weights.error_m
        least = min(least, d)
        if d >= weights.near_m:
            continue
        short, needed = weights.near_m - d, max(weights.close_m - d, 0.0)
        near, close = weights.points * weights.near, weights.points * weights.close
        cost += near * short * short + close * needed * needed
        pull, stiff = near * short + close * needed, near + (close if needed > 0.0 else 0.0)
        row[0], row[1] = nx, ny
        row[2] = -(py - lead[1]) * nx + (px - lead[0]) * ny
        row[3] = ((py - joint[1]) * nx - (px - joint[0]) * ny) if trails else 0.0
        for i in range(4):
            b[i] -= pull * row[i]
            for j in range(4):
                A[i, j] += stiff * row[i] * row[j]
    return cost, least


@nb.njit(cache=True, nogil=True)
def least_clearance(state: FloatArray, vehicle: Vehicle, outline: Outline, field: Field) -> float:
    """Return the least signed clearance of both bodies at a state (5,)."""
    weights = Weights(-math.inf, 0.0, -math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    _, least = _clearances(np.zeros((4, 4)), np.zeros(4), state, vehicle, weights, outline, field)
    return least


@nb.njit(cache=True, nogil=True)
def _route(
    A: FloatArray, b: FloatArray, state: FloatArray, path: FloatArray, at: int, weights: Weights, share: float
) -> float:
    """Add the route's part; return its cost."""
    heading = path[at, 2]
    c, s = math.cos(heading), math.sin(heading)
    off = -s * (state[0] - path[at, 0]) + c * (state[1] - path[at, 1])
    turned = (state[2] - heading + math.pi) % (2.0 * math.pi) - math.pi
    f = share * path[at, 4]
    wy, wt = f * weights.lateral, f * weights.heading
    b[0] -= wy * off * s
    b[1] += wy * off * c
    b[2] += wt * turned
    A[0, 0] += wy * s * s
    A[0, 1] -= wy * s * c
    A[1, 0] -= wy * s * c
    A[1, 1] += wy * c * c
    A[2, 2] += wt
    return wy * off * off + wt * turned * turned


@nb.njit(cache=True, nogil=True)
def _joint(A: FloatArray, b: FloatArray, bend: float, limit: float) -> float:
    """Add what a joint near its stop costs; return it."""
    over = abs(bend) - (limit - _JOINT_RESERVE)
    if over <= 0.0:
        return 0.0
    b[3] += _JOINT_WEIGHT * over * (1.0 if bend > 0.0 else -1.0)
    A[3, 3] += _JOINT_WEIGHT
    return _JOINT_WEIGHT * over * over


@nb.njit(cache=True, nogil=True)
def nearest_on(path: FloatArray, x: float, y: float, about: int) -> int:
    """Return the index of the path's point that is nearest to a place, near the last one."""
    best, found = math.inf, about
    for n in range(max(about - _BEHIND, 0), min(about + _AHEAD, len(path))):
        square = (path[n, 0] - x) ** 2 + (path[n, 1] - y) ** 2
        if square < best:
            best, found = square, n
    return found
