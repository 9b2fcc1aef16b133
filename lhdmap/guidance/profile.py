"""How fast: the least of what limits, clearance, bends, steering and sight allow along the predicted way, with limited jerk."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.guidance.directive import SPEED, Directive
from lhdmap.guidance.field import Field, distance
from lhdmap.guidance.prediction import Prediction
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.guidance.solver import Solution
from lhdmap.messages import FloatArray

_FREE_M, _BESIDE_M, _NARROW_M, _STOP_M = 0.5, 0.2, 0.05, -0.02
_STEERING_SHARE = 0.85
_CREEP_MPS = 0.3
_NEW_SHARE = 0.3
_TURN_S = 1.0  # from speeding up to slowing down: lag of the drive, jerk
_ASIDE_M, _ASIDE_LESS_M = 0.5, 0.15  # of the leading edge: there a wall may be nearer
_SIGHT_STEP_M, _SIGHT_CLEAR_M = 0.5, 0.10
_LEAVES_MPS, _NO_WORSE_M = 0.3, 0.02  # of a machine that leaves a pile, and how much less clearance is none


class Speeds(NamedTuple):
    """Speeds (K + 1,) at the ends of the stages, m/s, rates (K,) that keep the solution's way at them, rad/s; how long a stage is.

    `sight_m`: how far is seen; `by`: what limits the first metres; `clearance_m` (K + 1,), smoothed, at `along_m` of the path.
    """

    speed_mps: FloatArray
    rates: FloatArray
    step_s: float
    sight_m: float
    by: str
    along_m: FloatArray
    clearance_m: FloatArray


def speeds_of(
    solution: Solution,
    predicted: Prediction,
    start: tuple[float, float],
    directive: Directive,
    sight_m: float,
    ahead_m: FloatArray,
    last: Speeds | None,
    model: DriveModel,
    settings: GuidanceSettings,
) -> Speeds:
    """Return the speeds along a solution, from a speed and an acceleration at its start; `ahead_m` (K + 1,): `before_nose_m`."""
    along = _along(solution, directive.path)
    clear = _smoothed(solution.clearance_m, along, last)
    caps = _caps(solution, predicted, clear, directive, model, settings)
    caps["ahead"] = np.where(ahead_m > settings.ahead_m, float(model.top_speed_mps), 0.0)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(solution.states[:, :2], axis=0).T))])
    left_m = np.maximum(directive.stop_m - along, 0.0)
    braking, full = settings.brake_mps2, settings.sight_brake_share * model.brake_mps2
    caps["stop"] = np.sqrt(2.0 * braking * left_m)
    caps["sight"] = np.maximum(_stop_within(np.maximum(sight_m - way, 0.0), full, model), 0.3 * (sight_m > way))
    names = list(caps)
    table = np.stack([caps[name] for name in names])
    cap = table.min(axis=0)
    for k in range(len(cap) - 2, -1, -1):
        cap[k] = min(cap[k], math.sqrt(cap[k + 1] ** 2 + 2.0 * braking * (way[k + 1] - way[k])))
    speed, gone = _forward(cap, way, start, predicted.step_s, settings, model)
    rates = _rates(solution, predicted, speed, way, gone)
    first = names[int(table[:, : max(len(cap) // 3, 1)].min(axis=1).argmin())]
    return Speeds(speed, rates, predicted.step_s, sight_m, first, along, clear)


def _smoothed(clear: FloatArray, along: FloatArray, last: Speeds | None) -> FloatArray:
    """Return clearances (K + 1,) without the pose's noise: at each place a part of what is new; close ones as they are."""
    if last is None:
        return clear
    before = np.interp(along, last.along_m, last.clearance_m, right=math.nan)
    mixed = np.where(np.isnan(before), clear, before + _NEW_SHARE * (clear - before))
    return np.where(clear < _NARROW_M, np.minimum(clear, mixed), mixed)


def _rates(
    solution: Solution, predicted: Prediction, speed: FloatArray, way: FloatArray, gone: FloatArray
) -> FloatArray:
    """Return the rates (K,) that steer along the solution's way at other speeds; none where the machine stands."""
    slope = solution.rates / np.maximum(predicted.speed_mps, _CREEP_MPS)
    middles = 0.5 * (way[1:] + way[:-1])
    rates: FloatArray = np.interp(0.5 * (gone[1:] + gone[:-1]), middles, slope) * 0.5 * (speed[1:] + speed[:-1])
    return rates


def _along(solution: Solution, path: FloatArray) -> FloatArray:
    """Return how far along a path each state (K + 1,) is, between its points too."""
    points, states = path[solution.at], solution.states
    off = states[:, :2] - points[:, :2]
    along: FloatArray = points[:, 5] + np.cos(points[:, 2]) * off[:, 0] + np.sin(points[:, 2]) * off[:, 1]
    return along


def _caps(
    solution: Solution,
    predicted: Prediction,
    clear: FloatArray,
    directive: Directive,
    model: DriveModel,
    settings: GuidanceSettings,
) -> dict[str, FloatArray]:
    """Return what each limit allows at each state (K + 1,)."""
    top = float(model.top_speed_mps)
    at = solution.at
    beside = np.interp(
        clear, [_STOP_M, _NARROW_M, _BESIDE_M, _FREE_M], [0.0, settings.narrow_mps, settings.beside_mps, top]
    )
    if directive.leaves:
        beside = np.where(clear >= clear[0] - _NO_WORSE_M, np.maximum(beside, _LEAVES_MPS), beside)
    bend, rate = (
        solution.states[:, 3],
        np.convolve(np.pad(solution.rates, (1, 2), mode="edge"), np.ones(3) / 3.0, "valid"),
    )
    curvature = np.abs(np.sin(bend)) / (model.front_m * np.cos(bend) + model.rear_m)
    planned = math.radians(settings.rate_dps)
    with np.errstate(divide="ignore"):
        lateral = np.sqrt(settings.lateral_mps2 / np.maximum(curvature, 1e-6))
    reachable = _STEERING_SHARE * planned / np.maximum(np.abs(rate), 1e-6)
    return {
        "limit": directive.path[at, SPEED],
        "clearance": beside,
        "bend": lateral,
        "steering": np.maximum(np.append(predicted.speed_mps, predicted.speed_mps[-1]) * reachable, _CREEP_MPS),
    }


def _stop_within(way_m: FloatArray, brake_mps2: float, model: DriveModel) -> FloatArray:
    """Return the highest speed from which the machine stops within a way, dead time and ramp included."""
    blind = model.dead_time_s + 0.5 * model.brake_ramp_s
    speed: FloatArray = brake_mps2 * (np.sqrt(blind**2 + 2.0 * way_m / brake_mps2) - blind)
    return speed


def _forward(
    cap: FloatArray,
    way: FloatArray,
    start: tuple[float, float],
    step: float,
    settings: GuidanceSettings,
    model: DriveModel,
) -> tuple[FloatArray, FloatArray]:
    """Return speeds (K + 1,) under caps (K + 1,) along a way (K + 1,) and how far they lead: quick to slow, slow to speed up."""
    speed, gone, rise = np.empty(len(cap)), np.zeros(len(cap)), min(max(start[1], 0.0), settings.accelerate_mps2)
    speed[0] = start[0]
    for k in range(1, len(cap)):
        rise = min(rise + settings.jerk_mps3 * step, settings.accelerate_mps2)
        before, here = speed[k - 1], gone[k - 1] + speed[k - 1] * step
        soon = _at(cap, way, here + before * _TURN_S)  # who speeds up until the cap falls cannot follow it down
        wanted = min(_at(cap, way, here), before + rise * step, max(before, soon))
        speed[k] = max(wanted, speed[k - 1] - model.deceleration_mps2 * step, 0.0)
        gone[k] = gone[k - 1] + 0.5 * step * (speed[k] + speed[k - 1])
        rise = min(rise, max((speed[k] - speed[k - 1]) / step, 0.0))
    return speed, gone


@nb.njit(cache=True, nogil=True)
def _at(cap: FloatArray, way: FloatArray, gone: float) -> float:
    return float(np.interp(gone, way, cap))


@nb.njit(cache=True, nogil=True)
def _seen_m(x: float, y: float, path: FloatArray, first: int, field: Field) -> float:
    """Return how far along a path from its point `first` a straight look from (x, y) reaches."""
    seen = 0.0
    start = path[first, 5]
    for n in range(first, len(path), 2):
        dx, dy = path[n, 0] - x, path[n, 1] - y
        far = math.sqrt(dx * dx + dy * dy)
        gone = 0.5
        while gone < far:
            free, which = distance(x + gone * dx / far, y + gone * dy / far, field)
            if which >= 0 and free < _SIGHT_CLEAR_M:
                return seen
            gone += max(free, 0.2)
        seen = path[n, 5] - start
    return seen


def before_nose_m(states: FloatArray, field: Field, nose_m: float) -> FloatArray:
    """Return how far (K + 1,) the middle of the leading edge is from the nearest hit: walls beside are farther, half a width."""
    return np.array([_from_nose(x, y, heading, nose_m, field) for x, y, heading in states[:, :3].tolist()])


@nb.njit(cache=True, nogil=True)
def _from_nose(x: float, y: float, heading: float, nose_m: float, field: Field) -> float:
    free, _ = distance(x + nose_m * math.cos(heading), y + nose_m * math.sin(heading), field)
    for aside in (-_ASIDE_M, _ASIDE_M):
        px = x + nose_m * math.cos(heading) - aside * math.sin(heading)
        py = y + nose_m * math.sin(heading) + aside * math.cos(heading)
        beside, _ = distance(px, py, field)
        free = min(free, beside + _ASIDE_LESS_M)
    return free


def sight_m(eye: tuple[float, float], directive: Directive, first: int, field: Field, nose_m: float) -> float:
    """Return how far before the nose the path is seen from an eye (x, y), along it from its point `first`."""
    seen = _seen_m(eye[0], eye[1], directive.path, first, field)
    return max(seen - nose_m, 0.0)
