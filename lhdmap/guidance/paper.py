"""Guidance as printed: Eqs. (12) to (19) of the topological paper, minimised by sampling (cross-entropy). For comparison.

What it does not do well is measured in docs/guidance.md: nothing in it rewards progress, so the speed comes from the profile of
the default; |DL - DR| / (DL² DR²) is nothing where both sides are equally near; only six corners count. Eq. (18) is read as the
errata say: the share of the projected travel that lies in collision.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.driving.kernel import stepped
from lhdmap.guidance.cost import Index, Vehicle, least_clearance, nearest_on
from lhdmap.guidance.field import Field, distance
from lhdmap.guidance.outline import Outline
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.guidance.solver import Problem, Solution, rolled
from lhdmap.guidance.spline import spline_to, steering_rate
from lhdmap.messages import FloatArray

R_FRONT, R_MIDDLE, R_REAR = 1.0, 1.0, 1.0
R_STEERING, R_RATE_CHANGE, R_PROJECTED = 0.3, 30.0, 40.0
_CHANGE_RPS = math.radians(2.0)  # between two stages, before it costs
_TARGET_M = 9.0
_KNOTS = 8
_ELITE = 0.125
_SPREAD_RPS = math.radians(5.0)
_LEAST_M = 0.02
_COLLISION_M = 0.05


class PaperCost:
    """The printed cost. Chance comes from the problem itself, so the same cycle gives the same rates."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self._settings = settings

    def __call__(
        self, problem: Problem, guess: FloatArray, vehicle: Vehicle, outline: Outline, field: Field
    ) -> Solution:
        """Return the rates, from a guess (K,)."""
        settings, count = self._settings, len(guess)
        rng = np.random.Generator(np.random.Philox(key=abs(hash(problem.start.tobytes())) % 2**63))
        wanted = reference_rate(problem, vehicle)
        knots = np.linspace(0.0, count - 1.0, _KNOTS)
        mean, spread = np.interp(knots, np.arange(count), guess), np.full(_KNOTS, _SPREAD_RPS)
        corners = _corners(outline)
        best, best_cost = guess, printed_cost(problem, guess, wanted, vehicle, *corners, field)
        elite = max(round(_ELITE * settings.samples), 2)
        for _ in range(settings.rounds):
            drawn = np.clip(
                mean + spread * rng.standard_normal((settings.samples, _KNOTS)), -problem.limit, problem.limit
            )
            rates = np.stack([np.interp(np.arange(count), knots, one) for one in drawn])
            costs = costs_of(problem, rates, wanted, vehicle, *corners, field)
            order = np.argsort(costs)
            if costs[order[0]] < best_cost:
                best, best_cost = rates[order[0]], float(costs[order[0]])
            mean, spread = drawn[order[:elite]].mean(axis=0), drawn[order[:elite]].std(axis=0) + 1e-4
        states = rolled(problem.start, best, problem.speed, problem.step_s, vehicle)
        clear, at = _told(problem, states, vehicle, outline, field, settings.field_error_m)
        return Solution(best, states, clear, at, best_cost, settings.rounds)


def reference_rate(problem: Problem, vehicle: Vehicle) -> float:
    """Return the reference of Eq. (14): the rate that the spline to a target some metres ahead asks for, Eq. (9)."""
    start, path = problem.start, problem.path
    ahead = min(problem.at + round(_TARGET_M / 0.25), len(path) - 1)
    speed = max(float(problem.speed[0]), 0.3)
    try:
        spline = spline_to(start[:3], path[ahead, :3], speed)
    except ValueError:
        return 0.0
    rate = steering_rate(spline, speed, float(start[3]), vehicle.lead_m, vehicle.trail_m)
    return float(np.clip(rate, -problem.limit, problem.limit))


def _corners(outline: Outline) -> tuple[FloatArray, FloatArray]:
    """Return the corners: the front ones of the leading body (2, 2); middle (its back) and rear ones of the other (4, 2)."""
    lead, trail = outline.leading[:, :2], outline.trailing[:, :2]
    y = float(lead[:, 1].max())
    front = np.array([[lead[:, 0].max(), y], [lead[:, 0].max(), -y]])
    rest = np.array([[trail[:, 0].max(), y], [trail[:, 0].max(), -y], [trail[:, 0].min(), y], [trail[:, 0].min(), -y]])
    return front, rest


@nb.njit(cache=True, nogil=True)
def costs_of(
    problem: Problem,
    rates: FloatArray,
    wanted: float,
    vehicle: Vehicle,
    front: FloatArray,
    rest: FloatArray,
    field: Field,
) -> FloatArray:
    """Return the cost (N,) of rates (N, K)."""
    costs = np.empty(len(rates))
    for n in range(len(rates)):
        costs[n] = printed_cost(problem, rates[n], wanted, vehicle, front, rest, field)
    return costs


@nb.njit(cache=True, nogil=True)
def printed_cost(
    problem: Problem,
    rates: FloatArray,
    wanted: float,
    vehicle: Vehicle,
    front: FloatArray,
    rest: FloatArray,
    field: Field,
) -> float:
    """Return Q of Eq. (12) of rates (K,)."""
    states = rolled(problem.start, rates, problem.speed, problem.step_s, vehicle)
    cost, before = 0.0, problem.before
    for k in range(len(rates)):
        d = _distances(states[k + 1], vehicle, front, rest, field)
        cost += R_FRONT * _side(d[0], d[1]) + R_MIDDLE * _side(d[2], d[3]) + R_REAR * _side(d[4], d[5])  # Eq. (13)
        cost += R_STEERING * abs(rates[k] - wanted)  # Eq. (14)
        cost += R_RATE_CHANGE * max(abs(rates[k] - before) - _CHANGE_RPS, 0.0)  # Eqs. (16), (17); speeds are not free
        before = rates[k]
    return cost + R_PROJECTED * _projected(states[-1], rates[-1], problem, vehicle, front, rest, field, len(rates))


@nb.njit(cache=True, nogil=True)
def _side(left: float, right: float) -> float:
    left, right = max(left, _LEAST_M), max(right, _LEAST_M)
    return abs(left - right) / (left * left * right * right)


@nb.njit(cache=True, nogil=True)
def _projected(
    state: FloatArray,
    rate: float,
    problem: Problem,
    vehicle: Vehicle,
    front: FloatArray,
    rest: FloatArray,
    field: Field,
    count: int,
) -> float:
    """Return the share of the travel in collision where the last command is held as long again: Eqs. (18), (19)."""
    speed, inside, whole = problem.speed[-1], 0.0, 1e-9
    held = state.copy()
    for _ in range(count):
        after = stepped(
            (held[0], held[1], held[2], held[3], held[4]),
            speed,
            rate,
            problem.step_s,
            vehicle.lead_m,
            vehicle.trail_m,
            vehicle.lag_s,
        )
        for n in range(5):
            held[n] = after[n]
        way = speed * problem.step_s
        whole += way
        if _distances(held, vehicle, front, rest, field).min() < _COLLISION_M:
            inside += way
    return inside / whole


@nb.njit(cache=True, nogil=True)
def _distances(state: FloatArray, vehicle: Vehicle, front: FloatArray, rest: FloatArray, field: Field) -> FloatArray:
    """Return the unsigned distances (6,) of the corners from the nearest hit: front, middle, rear, each left and right."""
    x, y, heading = state[0], state[1], state[2]
    back = heading - state[3]
    c, s = math.cos(heading), math.sin(heading)
    cb, sb = math.cos(back), math.sin(back)
    tx, ty = x - vehicle.lead_m * c - vehicle.trail_m * cb, y - vehicle.lead_m * s - vehicle.trail_m * sb
    found = np.empty(6)
    for n in range(2):
        found[n] = distance(x + c * front[n, 0] - s * front[n, 1], y + s * front[n, 0] + c * front[n, 1], field)[0]
    for n in range(4):
        px, py = tx + cb * rest[n, 0] - sb * rest[n, 1], ty + sb * rest[n, 0] + cb * rest[n, 1]
        found[2 + n] = distance(px, py, field)[0]
    return found


def _told(
    problem: Problem, states: FloatArray, vehicle: Vehicle, outline: Outline, field: Field, error_m: float
) -> tuple[FloatArray, Index]:
    """Return the least clearance (K + 1,) of all outline points, as the speed profile wants it, and the path's points (K + 1,)."""
    clear = np.array([least_clearance(state, vehicle, outline, field) - error_m for state in states])
    at, found = problem.at, np.empty(len(states), np.int32)
    for k, state in enumerate(states):
        at = found[k] = nearest_on(problem.path, float(state[0]), float(state[1]), at)
    return clear, found
