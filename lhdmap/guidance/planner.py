"""Guidance: one call a cycle, from how the machine moves, the walls around it and a directive to setpoints for the next seconds.

motion, commands on their way -> start (where the first new command takes effect)
field of the local walls around the last prediction -> rates by a method -> speeds -> setpoints
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.kernel import stepped
from lhdmap.driving.lead import Lead, lead_of
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.guidance.cost import Vehicle, Weights
from lhdmap.guidance.directive import Directive
from lhdmap.guidance.field import Field, field_around
from lhdmap.guidance.outline import Outline, outline_of
from lhdmap.guidance.paper import PaperCost
from lhdmap.guidance.prediction import Prediction, Slopes, predicted
from lhdmap.guidance.profile import Speeds, before_nose_m, sight_m, speeds_of
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.guidance.solver import Problem, Solution, rolled, solve
from lhdmap.messages import FloatArray

_COMPUTING_NS = 30_000_000
_ROLL_S = 0.05
_OLD_NS = 1_000_000_000
_SAME_M = 1.0
_POINTS = 21.0  # of the outline that the findings' weights were found with
_SECOND_NS = 1_000_000_000


class Plan(NamedTuple):
    """What a cycle gives: setpoints; the predicted states (K + 1, 5) of the leading axle, their times, speeds and clearances.

    `by`: what limits the speed first; `sight_m`: how far is seen along the path before the nose.
    """

    stamp_ns: int
    gear: int
    setpoints: Setpoints
    begin_ns: int
    solution: Solution
    speeds: Speeds
    slopes: Slopes
    stop_m: float

    @property
    def clearance_m(self) -> float:
        """Least predicted clearance."""
        return float(self.solution.clearance_m.min())


class Method(Protocol):
    """Finds the rates of a cycle."""

    def __call__(
        self, problem: Problem, guess: FloatArray, vehicle: Vehicle, outline: Outline, field: Field
    ) -> Solution:
        """Return the rates, from a guess (K,)."""
        ...


class GaussNewton:
    """The default method (`lhdmap.guidance.solver`)."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self._settings = settings

    def __call__(
        self, problem: Problem, guess: FloatArray, vehicle: Vehicle, outline: Outline, field: Field
    ) -> Solution:
        """Return the rates, from a guess (K,)."""
        weights = weights_of(self._settings, len(outline.leading) + len(outline.trailing))
        return solve(problem, guess, vehicle, weights, outline, field, self._settings.iterations)


class Guidance:
    """Plans cycle by cycle; it keeps the last plan as a guess, nothing else. `eye_m`: of the scanner of each gear, on its body."""

    def __init__(
        self, model: DriveModel, bodies: Bodies, eyes_m: dict[int, float], settings: GuidanceSettings, method: Method
    ) -> None:
        self.model, self.settings, self._bodies = model, settings, bodies
        self._eyes_m, self._method = eyes_m, method
        self.loaded(model)

    def loaded(self, model: DriveModel) -> None:
        """Take the model for another load, and begin anew."""
        self.model = model
        self._leads = {gear: lead_of(gear, model, self._bodies) for gear in (1, -1)}
        self._outlines = {gear: outline_of(lead) for gear, lead in self._leads.items()}
        self._last: Plan | None = None

    def eyes_in_base(self, bend_rad: float) -> tuple[FloatArray, FloatArray]:
        """Return the places (2,) of the front and the rear scanner in `base_link`, at a joint angle."""
        behind = self.model.rear_m + self._eyes_m[-1]
        rear = np.array([-self.model.front_m - behind * math.cos(bend_rad), behind * math.sin(bend_rad)])
        return np.array([self._eyes_m[1], 0.0]), rear

    def forget(self) -> None:
        """Begin anew, without the last plan."""
        self._last = None

    def plan(
        self, now_ns: int, motion: Motion, sent: Sequence[Setpoint], hits: FloatArray, directive: Directive
    ) -> Plan:
        """Return the plan from now on.

        `sent`: the setpoints that have gone to the machine, in time order, those that have not taken effect among them; `hits`
        (N, 2) in `odom`.
        """
        settings, lead = self.settings, self._leads[directive.gear]
        begin_ns = now_ns + _COMPUTING_NS + round(self.model.dead_time_s * _SECOND_NS)
        start, speed, before = self._rolled_to(begin_ns, motion, sent, lead)
        at = int(np.hypot(directive.path[:, 0] - start[0], directive.path[:, 1] - start[1]).argmin())
        ahead = self._ahead(begin_ns, directive, start, at, speed)
        vehicle = Vehicle(lead.lead_m, lead.trail_m, self.model.steering_lag_s, self.model.max_articulation_rad)
        way = rolled(start, ahead.rates, ahead.speed_mps, ahead.step_s, vehicle)[:, :2]
        tail = start[:2] - (lead.lead_m + lead.trail_m) * np.array([math.cos(start[2]), math.sin(start[2])])
        field = field_around(hits, np.vstack([tail, way]))
        limit = math.radians(settings.rate_dps)
        problem = Problem(start, ahead.speed_mps, before, limit, ahead.step_s, directive.path, at)
        solution = self._method(problem, ahead.rates, vehicle, self._outlines[directive.gear], field)
        seen = self._sight(directive, lead, start, at, field)
        nose_m = before_nose_m(solution.states, field, float(lead.leading_m[:, 0].max()))
        start_at = (speed, self._rise(begin_ns))
        told = speeds_of(
            solution, ahead, start_at, directive, seen, nose_m, self._speeds(directive), self.model, settings
        )
        setpoints = self._setpoints(now_ns + _COMPUTING_NS, before, told, directive.gear)
        self._last = Plan(
            now_ns, directive.gear, setpoints, begin_ns, solution, told, slopes_of(solution, ahead), directive.stop_m
        )
        return self._last

    def _rolled_to(
        self, until_ns: int, motion: Motion, sent: Sequence[Setpoint], lead: Lead
    ) -> tuple[FloatArray, float, float]:
        """Return the leading axle's state when a command given now takes effect, its speed, and the rate in force then."""
        state, speed = lead.state(motion), lead.speed_mps(motion)
        dead_ns = round(self.model.dead_time_s * _SECOND_NS)
        at_ns, rate = motion.stamp_ns, 0.0
        first = 0
        while at_ns < until_ns:
            step_ns = min(round(_ROLL_S * _SECOND_NS), until_ns - at_ns)
            while first + 1 < len(sent) and sent[first + 1].at_ns + dead_ns <= at_ns:
                first += 1
            wanted = speed
            if first < len(sent):
                wanted, rate = lead.gear * sent[first].speed_mps, lead.gear * sent[first].steering_rate_rps
            step_s = step_ns / _SECOND_NS
            change = (wanted - speed) * -math.expm1(-step_s / self.model.drive_lag_s)
            most = self.model.acceleration_mps2 if change > 0.0 else self.model.deceleration_mps2
            after = speed + min(max(change, -most * step_s), most * step_s)
            state = stepped(
                state, 0.5 * (speed + after), rate, step_s, lead.lead_m, lead.trail_m, self.model.steering_lag_s
            )
            speed, at_ns = after, at_ns + step_ns
        return np.array(state), max(speed, 0.0), rate

    def _ahead(self, begin_ns: int, directive: Directive, start: FloatArray, at: int, speed: float) -> Prediction:
        """Return what to predict with: as the last plan went on, or straight on and speeding up."""
        settings, last = self.settings, self._last
        left_m = directive.stop_m - float(directive.path[at, 5])
        t: FloatArray = settings.stage_s * np.arange(settings.stages + 1, dtype=np.float64)
        if last is None or last.gear != directive.gear or begin_ns - last.begin_ns > _OLD_NS:
            self._last = None
            allowed = float(directive.path[at:, 3].min()) if at < len(directive.path) else 0.0
            rising: FloatArray = np.minimum(speed + settings.accelerate_mps2 * t, max(allowed, speed))
            return predicted((rising, t), None, left_m, settings)
        gone_s = (begin_ns - last.begin_ns) / _SECOND_NS
        at_s: FloatArray = last.speeds.step_s * np.arange(len(last.speeds.speed_mps), dtype=np.float64) - gone_s
        off = speed - float(np.interp(0.0, at_s, last.speeds.speed_mps))
        coming = last.speeds.speed_mps + off * np.exp(-np.maximum(at_s, 0.0) / 0.5)  # what it really drives
        expected: FloatArray = np.maximum(coming, 0.0)
        gone_m = float(np.linalg.norm(start[:2] - last.solution.states[0, :2]))
        return predicted((expected, at_s), last.slopes._replace(at_m=last.slopes.at_m - gone_m), left_m, settings)

    def _rise(self, begin_ns: int) -> float:
        """Return the acceleration that the last plan has at a time."""
        if self._last is None:
            return 0.0
        speeds = self._last.speeds
        k = int((begin_ns - self._last.begin_ns) / _SECOND_NS / speeds.step_s)
        return float(np.diff(speeds.speed_mps)[min(k, len(speeds.speed_mps) - 2)]) / speeds.step_s

    def _speeds(self, directive: Directive) -> Speeds | None:
        """Return the speeds of the last plan, if it was along the same path."""
        same = self._last is not None and abs(self._last.stop_m - directive.stop_m) < _SAME_M
        return self._last.speeds if self._last is not None and same else None

    def _sight(self, directive: Directive, lead: Lead, start: FloatArray, at: int, field: Field) -> float:
        eye = self._eyes_m[directive.gear]
        place = start[0] + eye * math.cos(start[2]), start[1] + eye * math.sin(start[2])
        return sight_m(place, directive, at, field, float(lead.leading_m[:, 0].max()))

    def _setpoints(self, from_ns: int, before: float, told: Speeds, gear: int) -> Setpoints:
        """Return the setpoints: speeds at the ends of the stages, rates in their middles, on one time line."""
        step, count = told.step_s, len(told.rates)
        ends, middles = step * np.arange(count + 1), step * (np.arange(count) + 0.5)
        knots = np.concatenate([[0.0], middles])
        rates = np.concatenate([[0.5 * (before + told.rates[0])], told.rates])
        times = np.unique(np.concatenate([ends, middles]))
        speed, rate = np.interp(times, ends, told.speed_mps), np.interp(times, knots, rates)
        return tuple(
            Setpoint(from_ns + round(t * _SECOND_NS), gear * v, gear * w)
            for t, v, w in zip(times.tolist(), speed.tolist(), rate.tolist(), strict=True)
        )


def slopes_of(solution: Solution, ahead: Prediction) -> Slopes:
    """Return the way of a solution as slopes of the joint."""
    way = ahead.speed_mps * ahead.step_s
    return Slopes(np.cumsum(way) - 0.5 * way, solution.rates / np.maximum(ahead.speed_mps, 0.01))


def method_of(settings: GuidanceSettings) -> Method:
    """Return the method that the settings name."""
    return PaperCost(settings) if settings.method == "paper" else GaussNewton(settings)


def weights_of(settings: GuidanceSettings, points: int) -> Weights:
    """Return the weights for so many outline points."""
    return Weights(
        near_m=settings.near_m,
        near=settings.near_weight,
        close_m=settings.close_m,
        close=settings.close_weight,
        error_m=settings.field_error_m,
        lateral=settings.lateral_weight,
        heading=settings.heading_weight,
        end=settings.end_share,
        change=settings.change_weight,
        rate=settings.rate_weight,
        points=_POINTS / points,
    )
