"""The tracker: each period from how the machine moves to a speed, a rate of the joint, and setpoints for the next seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import reduced
from lhdmap.tracking.filter import Filter
from lhdmap.tracking.gains import Gains, direction
from lhdmap.tracking.kernel import State, front_axle
from lhdmap.tracking.law import errors_of_circle, errors_of_curve
from lhdmap.tracking.path import STEP_M, Path, nearest, path_of
from lhdmap.tracking.printed import PrintedLaw
from lhdmap.tracking.reference import Curve, reference_of
from lhdmap.tracking.rollout import STAGE_S, STAGES, Bounds, Loop, Start, rolled, speed_at
from lhdmap.tracking.settings import TrackingSettings
from lhdmap.tracking.speeds import Speeds, most_change, speeds_of

_BEYOND_M = 4.0  # the path goes on so far beyond its ends, and by the machine's length
_ARRIVED_M, _STANDING_MPS = 0.05, 0.05
_KEPT = 120
_SLOW_SHARE = 0.5  # of the drive's deceleration, to slow down beside the path


class Step(NamedTuple):
    """What the machine is to do: signed speed of the front axle (m/s), rate of the joint (rad/s), setpoints from now on.

    `state`: "tracking", "arrived", or "stopped" with a `reason`; `errors` (4,): z1, θ̃1, β, ω against the reference when a command
    that is given now counts; `left_m`: way to the end.
    """

    speed_mps: float
    steering_rate_rps: float
    setpoints: Setpoints
    state: str
    reason: str
    errors: FloatArray
    left_m: float


class Leg(NamedTuple):
    """What is tracked: a curve, its speeds, and the path with its waypoints where there is one."""

    curve: Curve
    speeds: Speeds
    path: Path | None
    waypoints: FloatArray


class Tracker:
    """`follow` a path or `follow_curve` a curve, then `step` each time that a motion is there, 20 times a second or so."""

    def __init__(self, model: DriveModel, settings: TrackingSettings) -> None:
        self.model, self.settings = model, settings
        self.filter, self.gains = Filter(model, settings), Gains(model, settings)
        self.leg: Leg | None = None
        self.sent: list[Setpoint] = []
        self._printed = PrintedLaw(model, settings)
        self._along_m, self._rear_mps, self._state = -1.0, 0.0, "stopped"
        self._step_ns = 0

    def follow(self, path: FloatArray, speeds: float | FloatArray) -> Curve:
        """Follow waypoints (N, 2) or (N, 3) in the order in which they are driven, to a stop at the last.

        `speeds`, m/s: one or (N,), of the front axle; negative in reverse, where the rear axle goes first.

        Raises:
            InputError: no path, or none that the machine can follow; what was followed before stays.
        """
        asked = np.broadcast_to(np.asarray(speeds, dtype=np.float64), (len(path),))
        if not np.isfinite(asked).all() or not ((asked > 0.0).all() or (asked < 0.0).all()):
            raise InputError("speeds of a path are finite and of one sign, none is 0")
        gear = 1 if asked[0] > 0.0 else -1
        waypoints, asked = (path, asked) if gear > 0 else (path[::-1], asked[::-1])
        lengths = (self.model.front_m, self.model.rear_m)
        laid = path_of(waypoints, self.settings.smoothing_m, sum(lengths) + _BEYOND_M)
        speed = _at_points(laid, waypoints, np.abs(asked))
        most = most_change(speed, laid.points[:, 3], self.model, self.settings)
        curve = reference_of(laid, gear, most, lengths)
        bent = float(np.abs(curve.rows[:, 4]).max())
        if bent > self.model.max_articulation_rad:
            told = f"{math.degrees(bent):.0f} deg of the joint, of {math.degrees(self.model.max_articulation_rad):.0f}"
            raise InputError(f"the path bends more than the machine: it asks for {told}")
        ahead = round((0.0 if gear < 0 else sum(lengths)) / STEP_M)  # the speed is that of the leading axle's place
        at_rows = speed[np.minimum(np.arange(len(curve.rows)) + ahead, len(speed) - 1)]
        self._begin(
            Leg(curve, speeds_of(curve, at_rows, self.model, self.settings), laid, np.asarray(waypoints)[:, :2])
        )
        return curve

    def follow_curve(self, curve: Curve, speed_mps: float) -> None:
        """Follow a curve of configurations, as docking plans it, to a stop at its end."""
        asked = np.full(len(curve.rows), abs(speed_mps))
        self._begin(Leg(curve, speeds_of(curve, asked, self.model, self.settings), None, curve.rows[:, :2]))

    def _begin(self, leg: Leg) -> None:
        self.leg, self._along_m, self._state = leg, -1.0, "tracking"
        self._printed.restart()

    def step(self, now_ns: int, motion: Motion | None, sent: Sequence[Setpoint] | None = None) -> Step:
        """Return what to do. `sent`: commands as they were given, in the order of time; None: all that this said was done."""
        given = self.sent if sent is None else sent
        if motion is not None:
            self.filter.take(motion, given)
        leg = self.leg
        if leg is None or not self.filter.known:
            return self._stop(now_ns, "no path" if leg is None else "no motion")
        if now_ns - self.filter.stamp_ns > self.settings.age_s * 1e9:
            return self._stop(now_ns, "the last motion is too old")
        dead_ns = round(self.model.dead_time_s * 1e9)
        state, _ = self.filter.ahead(now_ns + dead_ns, given)
        if self._along_m < 0.0:
            self._along_m = nearest(leg.curve.rows, state[0], state[1], state[2])
        slip = float(self.filter.state[5])
        lengths = (self.model.front_m, self.model.rear_m)
        rear = self.filter.rear_mps
        found = errors_of_curve(leg.curve, state, slip, self._along_m, rear, lengths)
        self._along_m = found.along_m
        left = leg.curve.gear * (leg.curve.to_m - found.along_m)
        if abs(found.x[0]) > self.settings.lost_m:
            return self._stop(now_ns, f"{abs(found.x[0]):.1f} m from the path")
        if left < _ARRIVED_M and abs(self.filter.front_mps) < _STANDING_MPS:
            self._state = "arrived"
        if self._state == "arrived":
            return self._stop(now_ns, "", found.x, left)
        x = found.x
        if self.settings.method == "circles" and leg.path is not None:
            x = errors_of_circle(leg.path, state, slip, found.along_m, self.settings.look_m, lengths)
        return self._out(now_ns, motion, leg, state, Found(x, found.along_m, left))

    def _out(self, now_ns: int, motion: Motion | None, leg: Leg, state: State, errors: Found) -> Step:
        period = min(max((now_ns - self._step_ns) * 1e-9, 0.0), 0.2) if self._step_ns else 0.05
        speed = min(self._rear_mps + self.settings.accelerate_mps2 * period, abs(self.filter.rear_mps) + 1.0)
        if abs(errors.x[0]) > self.settings.clip_m:
            braked = self._rear_mps - _SLOW_SHARE * self.model.deceleration_mps2 * period
            speed = min(speed, max(self.settings.aside_mps, braked))
        rolled = self._rolled(leg, state, errors, speed)
        if self.settings.method == "paper":
            raw = self._last_motion(motion, state)
            rate = self._printed.rate(raw, self.filter.rear_mps, leg.waypoints)
            fade = np.exp(-np.arange(STAGES + 1) * STAGE_S / 0.2)
            rolled[:, 1] = _within(rate, self.model.max_rate_rps) * fade
        self._rear_mps, self._step_ns = abs(rolled[0, 2]), now_ns
        points = tuple(
            Setpoint(now_ns + round(k * STAGE_S * 1e9), speed, rate)
            for k, (speed, rate, _) in enumerate(rolled.tolist())
        )
        self._note(points[0])
        return Step(points[0].speed_mps, points[0].steering_rate_rps, points, "tracking", "", errors.x, errors.left_m)

    def _rolled(self, leg: Leg, state: State, errors: Found, speed: float) -> FloatArray:
        """Return (K + 1, 3): speed of the front axle, rate, speed of the rear axle, of the closed loop from the state on."""
        one, gear, lengths = self.settings, leg.curve.gear, self.filter.lengths
        speed = min(speed, speed_at(leg.speeds.caps_mps, errors.along_m, errors.left_m, leg.speeds.brake_mps2))
        design = direction(self.filter.rear_mps, gear) * max(speed, one.slow_mps)
        a, b = reduced(design, lengths[2], lengths[:2])
        feed = 1.0 if one.method == "both" or leg.path is None else 0.0
        loop = Loop(self.gains.at(design, gear), a, b[:, 0], gear, lengths, feed)
        model, aside = self.model, abs(errors.x[0]) > one.clip_m
        bounds = Bounds(
            one.clip_m,
            one.slow_mps,
            one.accelerate_mps2,
            leg.speeds.brake_mps2,
            model.max_rate_rps,
            one.aside_mps if aside else math.inf,
            _SLOW_SHARE * model.deceleration_mps2,
            one.swerve_share * one.lateral_mps2,
            model.max_articulation_rad,
        )
        start = Start(errors.x, errors.along_m, errors.left_m, speed, state[3])
        return rolled(leg.curve.rows, leg.speeds.caps_mps, start, loop, bounds)

    def _last_motion(self, motion: Motion | None, state: State) -> Motion:
        if motion is not None and all(math.isfinite(value) for value in motion):
            return motion
        return Motion(0, *front_axle(state, self.filter.lengths), state[3], state[4], self.filter.front_mps)

    def _stop(self, now_ns: int, reason: str, x: FloatArray | None = None, left_m: float = math.nan) -> Step:
        """Return a standstill: a plan that ends, which the executor brakes for."""
        self._rear_mps, self._step_ns = 0.0, now_ns
        points = (Setpoint(now_ns, 0.0, 0.0), Setpoint(now_ns + round(STAGES * STAGE_S * 1e9), 0.0, 0.0))
        self._note(points[0])
        state = "arrived" if self._state == "arrived" and not reason else "stopped"
        return Step(0.0, 0.0, points, state, reason, np.full(4, math.nan) if x is None else x, left_m)

    def _note(self, point: Setpoint) -> None:
        self.sent.append(point)
        del self.sent[:-_KEPT]


class Found(NamedTuple):
    """Errors (4,), where on the curve, way to its end (m)."""

    x: FloatArray
    along_m: float
    left_m: float


def _at_points(path: Path, waypoints: FloatArray, asked: FloatArray) -> FloatArray:
    """Return the speed at each point of a path: of the waypoint before it in the direction of the path."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(np.asarray(waypoints)[:, :2], axis=0).T))])
    way *= (path.end_m - path.begin_m) / max(float(way[-1]), 1e-9)
    found: FloatArray = np.interp(np.arange(len(path.points)) * STEP_M - path.begin_m, way, asked)
    return found


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)
