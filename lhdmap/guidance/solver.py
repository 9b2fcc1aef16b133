"""The optimiser: rates of the joint over the horizon, by Gauss-Newton in single shooting, with analytic sensitivities (numba).

The stages' costs (`lhdmap.guidance.cost`) are collapsed to 4 x 4 in (x, y, θ, γ), condensed to the K rates; bounds by an
active set, damping after Levenberg.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.driving.kernel import stepped
from lhdmap.guidance.cost import Expansion, Index, Stage, Vehicle, Weights, stage_cost
from lhdmap.guidance.field import Field
from lhdmap.guidance.outline import Outline
from lhdmap.messages import FloatArray


class Problem(NamedTuple):
    """What is asked of a cycle.

    `start` (5,): the leading axle's state when the first rate takes effect; `speed` (K,); `before`: the rate in force then;
    `limit` of the rates; `path` as in a directive, `at`: its point near the start.
    """

    start: FloatArray
    speed: FloatArray
    before: float
    limit: float
    step_s: float
    path: FloatArray
    at: int


class Solution(NamedTuple):
    """Rates (K,), states (K + 1, 5), least clearance (K + 1,) less the field's error, nearest point of the path (K + 1,)."""

    rates: FloatArray
    states: FloatArray
    clearance_m: FloatArray
    at: Index
    cost: float
    iterations: int


@nb.njit(cache=True, nogil=True)
def rolled(start: FloatArray, rates: FloatArray, speed: FloatArray, step_s: float, vehicle: Vehicle) -> FloatArray:
    """Return the states (K + 1, 5) from a start."""
    states = np.empty((len(rates) + 1, 5))
    states[0] = start
    for k in range(len(rates)):
        s = states[k]
        after = stepped(
            (s[0], s[1], s[2], s[3], s[4]), speed[k], rates[k], step_s, vehicle.lead_m, vehicle.trail_m, vehicle.lag_s
        )
        for n in range(5):
            states[k + 1, n] = after[n]
    return states


@nb.njit(cache=True, nogil=True)
def solve(
    problem: Problem,
    guess: FloatArray,
    vehicle: Vehicle,
    weights: Weights,
    outline: Outline,
    field: Field,
    most: int,
) -> Solution:
    """Return the best rates, from a guess (K,), in at most so many steps."""
    count = len(guess)
    rates = np.minimum(np.maximum(guess, -problem.limit), problem.limit)
    states = rolled(problem.start, rates, problem.speed, problem.step_s, vehicle)
    best = expanded(problem, rates, states, vehicle, weights, outline, field)
    damping, used = 1e-3, 0
    while used < most and damping < 1e3:
        used += 1
        ridge = damping * np.trace(best.H) / count + 1e-9
        tried = rates + _bounded_step(best.H, best.g, rates, problem.limit, ridge)
        states_after = rolled(problem.start, tried, problem.speed, problem.step_s, vehicle)
        after = expanded(problem, tried, states_after, vehicle, weights, outline, field)
        if after.cost >= best.cost:
            damping = max(10.0 * damping, 1e-2)
            continue
        gained = best.cost - after.cost
        rates, states, best = tried, states_after, after
        damping = max(0.2 * damping, 1e-6)
        if gained < 1e-4 * (best.cost + 1e-6):
            break
    return Solution(rates, states, best.clearance_m, best.at, best.cost, used)


@nb.njit(cache=True, nogil=True)
def expanded(
    problem: Problem,
    rates: FloatArray,
    states: FloatArray,
    vehicle: Vehicle,
    weights: Weights,
    outline: Outline,
    field: Field,
) -> Expansion:
    """Return cost, gradient and Hessian over the rates."""
    count = len(rates)
    H, g = np.zeros((count, count)), np.zeros(count)
    least, along = np.empty(count + 1), np.empty(count + 1, np.int32)
    S = np.zeros((5, count))
    cost, at = 0.0, problem.at
    for k in range(count + 1):
        if k > 0:
            _sensitivities(S, states[k - 1], problem.speed[k - 1], rates[k - 1], problem.step_s, vehicle, k - 1)
        share = weights.end if k == count else 1.0
        stage = stage_cost(states[k], problem.path, at, share, vehicle, weights, outline, field)
        least[k], at = stage.clearance_m, stage.at
        along[k] = at
        cost += stage.cost
        _condensed(H, g, S, stage, k)
    cost += _smooth(H, g, rates, problem.before, weights)
    for i in range(count):
        for j in range(i):
            H[j, i] = H[i, j]
    return Expansion(cost, H, g, least, along)


@nb.njit(cache=True, nogil=True)
def _condensed(H: FloatArray, g: FloatArray, S: FloatArray, stage: Stage, count: int) -> None:
    """Add a stage's 4 x 4 to the rates before it: S' A S and S' b, lower triangle."""
    for i in range(count):
        for m in range(4):
            t = 0.0
            for n in range(4):
                t += stage.A[m, n] * S[n, i]
            g[i] += S[m, i] * stage.b[m]
            for j in range(i + 1):
                H[i, j] += S[m, j] * t


@nb.njit(cache=True, nogil=True)
def _smooth(H: FloatArray, g: FloatArray, rates: FloatArray, before: float, weights: Weights) -> float:
    """Add what rates and their changes cost; return it."""
    cost = 0.0
    for k in range(len(rates)):
        change = rates[k] - before
        cost += weights.change * change * change + weights.rate * rates[k] * rates[k]
        g[k] += weights.change * change + weights.rate * rates[k]
        H[k, k] += weights.change + weights.rate
        if k > 0:
            g[k - 1] -= weights.change * change
            H[k - 1, k - 1] += weights.change
            H[k, k - 1] -= weights.change
        before = rates[k]
    return cost


@nb.njit(cache=True, nogil=True)
def _sensitivities(
    S: FloatArray, state: FloatArray, speed: float, rate: float, step_s: float, vehicle: Vehicle, k: int
) -> None:
    """Carry d(state)/d(rates) (5, K) over a step; see `lhdmap.driving.kernel.stepped` for the step itself."""
    lead, trail = vehicle.lead_m, vehicle.trail_m
    gone = -math.expm1(-step_s / vehicle.lag_s)
    kept = vehicle.lag_s * gone
    pushed = step_s - kept
    moved = kept * state[4] + pushed * rate
    middle, mean_rate = state[3] + 0.5 * moved, moved / step_s
    below = lead * math.cos(middle) + trail
    above = speed * math.sin(middle) + trail * mean_rate
    turn = above / below
    by_middle = speed * math.cos(middle) / below + above * lead * math.sin(middle) / (below * below)
    by_rate = trail / below
    half = state[2] + 0.5 * step_s * turn
    way = speed * step_s
    c, s = way * math.cos(half), way * math.sin(half)
    for i in range(k + 1):
        heading, bend, bend_rate = S[2, i], S[3, i], S[4, i]
        own = 1.0 if i == k else 0.0
        shift = kept * bend_rate + pushed * own
        turned = by_middle * (bend + 0.5 * shift) + by_rate * shift / step_s
        mid = heading + 0.5 * step_s * turned
        S[0, i] -= s * mid
        S[1, i] += c * mid
        S[2, i] = heading + step_s * turned
        S[3, i] = bend + shift
        S[4, i] = (1.0 - gone) * bend_rate + gone * own


@nb.njit(cache=True, nogil=True)
def _bounded_step(H: FloatArray, g: FloatArray, rates: FloatArray, limit: float, ridge: float) -> FloatArray:
    """Return the step that solves (H + ridge) step = -g within bounds: what would leave them is held, the rest solved again."""
    count = len(g)
    held = np.zeros(count, np.bool_)
    step = np.zeros(count)
    for n in range(count):
        held[n] = (rates[n] >= limit and g[n] < 0.0) or (rates[n] <= -limit and g[n] > 0.0)
    for _ in range(4):
        step = _solved(H, g, held, step, ridge)
        after = rates + step
        beyond = ~held & (np.abs(after) > limit)
        if not beyond.any():
            break
        held |= beyond
        step = np.where(beyond, np.sign(after) * limit - rates, step)
    clipped: FloatArray = np.minimum(np.maximum(step, -limit - rates), limit - rates)
    return clipped


@nb.njit(cache=True, nogil=True)
def _solved(H: FloatArray, g: FloatArray, held: npt.NDArray[np.bool_], step: FloatArray, ridge: float) -> FloatArray:
    """Return the step with some of its values held at what they are."""
    M, right = H.copy(), -g
    for i in range(len(g)):
        M[i, i] += ridge
        if held[i]:
            right -= H[:, i] * step[i]
    for i in range(len(g)):
        if held[i]:
            M[i, :] = 0.0
            M[:, i] = 0.0
            M[i, i] = 1.0
            right[i] = step[i]
    return np.asarray(np.linalg.solve(M, right))
