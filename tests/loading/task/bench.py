"""A drift with a pile at its end, in plan: kinematic machine, real guidance, a bucket of one joint; no ground, no perception."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from lhdmap.driving.lead import lead_of
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.geometry import se2
from lhdmap.guidance.directive import HEADING, SPEED, WAY, Directive
from lhdmap.guidance.planner import Guidance, method_of
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.loading.assistance import Operator
from lhdmap.loading.digging_parts import Controllers
from lhdmap.loading.identification import at_pile
from lhdmap.loading.moment import LoadingInput, LoadingOutput, Mission
from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.states import State
from lhdmap.loading.task import LoadingTask
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray
from lhdmap.pile.result import AttackPoint, PileEstimate, Snapshot

from tests.guidance.planar_drive import EYES_M, Errors, Truth
from tests.guidance.tunnels import BODIES, MODEL, room

SECOND_NS = 1_000_000_000
STEP_NS, CALL_NS, PLAN_NS = 10_000_000, 40_000_000, 80_000_000
TOP_MPS = 2.6  # first gear at full pedal
LIP_M = float(BODIES.front_box_m[1, 0])


@dataclass(frozen=True)
class Drift:
    """A straight drift along x whose pile begins at x = `toe_m`: half its width, offset and skew of the pile's toe."""

    toe_m: float = 30.0
    half_m: float = 2.2
    skew_rad: float = 0.0

    @property
    def limits_m(self) -> FloatArray:
        """E_R, E_L."""
        slope = math.tan(self.skew_rad)
        return np.array([[self.toe_m + side * self.half_m * slope, side * self.half_m] for side in (-1.0, 1.0)])

    @property
    def walls_m(self) -> FloatArray:
        """Wall points each 8 cm, on to 2 m past the toe."""
        x = np.arange(-15.0, self.toe_m + 2.0, 0.08)
        return np.vstack([np.column_stack([x, np.full(len(x), side * self.half_m)]) for side in (-1.0, 1.0)])

    @property
    def face_m(self) -> FloatArray:
        """Points of the face at the scanner's height, 1 m behind the toe."""
        right, left = self.limits_m
        t = np.linspace(0.02, 0.98, 40)[:, None]
        return right + t * (left - right) + np.array([1.0, 0.0])

    def snapshot(self, stamp_ns: int, status: str = "loadable") -> Snapshot:
        """What perception says of it."""
        right, left = self.limits_m
        middle = self.limits_m.mean(axis=0)
        estimate = PileEstimate(
            status=status,
            probabilities={status: 1.0},
            center_m=np.array([middle[0] + 1.2, middle[1], 0.8]),
            left_limit_m=np.append(left, 0.0),
            right_limit_m=np.append(right, 0.0),
            width_m=2.0 * self.half_m,
            inclination_deg=-48.0,
            attack=AttackPoint(np.append(middle, 0.0), 0.0),
        )
        return Snapshot(stamp_ns, 10.0, estimate)


def shown(call: Callable[[Signals, int], Turn]) -> Any:
    """A controller of a function of signals and steps since its begin."""

    class One:
        def begin(self, signals: Signals) -> None:
            self.steps = 0

        def step(self, signals: Signals) -> Turn:
            self.steps += 1
            return call(signals, self.steps)

    return One()


def controllers(fill: float = 0.9) -> Controllers:
    """Simple ones: charge until 0.5 m in the pile, dig for 3 s, shake for 1 s, weigh for 2 s."""
    charge = shown(lambda s, n: Turn(Pedals(0.5), "collision" if s.toe_m < -0.5 else ""))
    dig = shown(lambda s, n: Turn(Pedals(0.1, 0.5), "racked" if n > 150 else ""))
    shake = shown(lambda s, n: Turn(Pedals(tilt=0.5 * (-1) ** (n // 10)), "shaken" if n > 50 else ""))
    weigh = shown(lambda s, n: Turn(Pedals(), "settled" if n > 100 else "", (("fill", fill), ("fill_std", 0.03))))
    return Controllers(charge, dig, shake, weigh)


class Said(NamedTuple):
    go_on: bool
    text: str
    values: tuple[tuple[str, float], ...] = ()


class Until:
    """A rule: on until a fill, so often at most."""

    def __init__(self, fill: float = 0.85, most: int = 4) -> None:
        self._fill, self._most = fill, most

    def decide(self, fill: float, fill_std: float, attempt: int) -> Said:
        on = fill < self._fill and attempt < self._most
        return Said(on, f"fill {fill:.2f} after {attempt}")


@dataclass
class Bench:
    """Runs the task on the machine; `change` may alter what it is told.

    `guided`: real guidance drives; otherwise the machine runs along the path itself, which is quicker.
    """

    drift: Drift
    task: LoadingTask
    start: FloatArray
    bend_rad: float = 0.0
    operator: Operator | None = None
    change: Callable[[LoadingInput], LoadingInput] = lambda told: told
    guided: bool = False
    now_ns: int = 0
    bucket_rad: float = 0.0
    boom_rad: float = 0.0
    press_bar: float = 8.0
    said: list[LoadingOutput] = field(default_factory=list)
    notes: list[tuple[int, Any]] = field(default_factory=list)
    rooms_m: list[float] = field(default_factory=list)
    speeds_mps: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.truth = Truth(np.array([*self.start, self.bend_rad, 0.0]), MODEL, Errors())
        settings = GuidanceSettings()
        self._guidance = Guidance(MODEL, BODIES, EYES_M, settings, method_of(settings))
        self._walls_m = self.drift.walls_m
        self._points = np.vstack([self._walls_m, self.drift.face_m])
        self._queue: Setpoints = ()
        self._planned_ns = -SECOND_NS
        self._pedals = Pedals(brake=True)
        self._travel_m = 0.0
        self._pile: Snapshot | None = None
        self._seen_m = 0.0
        self._rng = np.random.default_rng(5)

    def run(self, seconds: float, until: Callable[[LoadingOutput], bool] = lambda out: False) -> LoadingOutput:
        """Run for so long, or until something is said."""
        end = self.now_ns + round(seconds * SECOND_NS)
        while self.now_ns < end:
            if self.now_ns % CALL_NS == 0:
                out = self._call()
                if until(out):
                    break
            self._move()
        return self.said[-1]

    def _call(self) -> LoadingOutput:
        asked = self.said[-1].request if self.said else None
        answer = self.operator.answer(asked, self.now_ns) if self.operator is not None and asked is not None else None
        motion = self.motion()
        told = LoadingInput(
            self.now_ns, self.signals(), motion, self._seen(), self._walls(motion),
            answer=answer, mission=Mission(1, (self.drift.toe_m, 0.0)),
        )  # fmt: skip
        out = self.task.update(self.change(told))
        self.said.append(out)
        self.notes += [(self.now_ns, note) for note in out.notes]
        self._command(out, motion)
        return out

    def _seen(self) -> Snapshot:
        """Return what perception says: it looks anew each 0.5 m of travel."""
        if self._pile is None or abs(self._travel_m - self._seen_m) >= 0.5:
            self._pile, self._seen_m = self.drift.snapshot(self.now_ns), self._travel_m
        return self._pile

    def _walls(self, motion: Motion) -> FloatArray:
        c, s = math.cos(motion.heading_rad), math.sin(motion.heading_rad)
        d = self._points - np.array([motion.x_m, motion.y_m])
        return d[np.hypot(*d.T) < 16.0] @ np.array([[c, -s], [s, c]])

    def _command(self, out: LoadingOutput, motion: Motion) -> None:
        """Drive as guidance, pedals or the brake say."""
        self._pedals = out.pedals or Pedals(brake=out.directive is None)
        if out.directive is not None and not self.guided:
            return
        if out.directive is not None:
            if self.now_ns - self._planned_ns >= PLAN_NS:
                self._planned_ns = self.now_ns
                plan = self._guidance.plan(self.now_ns, motion, self.truth.sent[-60:], self._near(), out.directive)
                self._queue = plan.setpoints
            times = np.array([one.at_ns for one in self._queue], dtype=float)
            speeds = np.array([one.speed_mps for one in self._queue])
            rates = np.array([one.steering_rate_rps for one in self._queue])
            speed, later = np.interp([self.now_ns, self.now_ns + 1e8], times, speeds).tolist()
            rate = float(np.interp(self.now_ns, times, rates))
            lag = MODEL.drive_lag_s * (later - speed) / 0.1
            self.truth.sent.append(Setpoint(self.now_ns, speed + lag, rate))
            return
        self._guidance.forget()
        self._planned_ns = -SECOND_NS
        speed = 0.0 if self._pedals.brake else TOP_MPS * self._pedals.propel
        self.truth.sent.append(Setpoint(self.now_ns, speed, self._pedals.steering_rate_rps))

    def _near(self) -> FloatArray:
        """The points that guidance sees: the pile is no obstacle."""
        points, target = self._points, self.said[-1].target
        if target is not None and self.said[-1].state == State.PULL_BACK:
            points = points[~at_pile(points, target.limits_m, 8.0)]
        return points[np.hypot(*(points - self.truth.state[:2]).T) < 25.0]

    def _move(self) -> None:
        directive = self.said[-1].directive
        if directive is None or self.guided:
            self.truth.step(self.now_ns)
        elif self.now_ns % 20_000_000 == 0:
            self._follow(directive, 0.02)
        stands = self._pedals.brake and abs(self.truth.speed) < 0.02
        self.truth.speed = 0.0 if stands else self.truth.speed
        self._travel_m += self.truth.speed * 0.01
        self.bucket_rad = min(max(self.bucket_rad + 0.2 * self._pedals.tilt * 0.01, -0.83), 0.0)
        self.boom_rad = min(max(self.boom_rad + 0.1 * self._pedals.lift * 0.01, 0.0), 0.85)
        pressing = self.bucket_rad <= -0.83 and self._pedals.tilt < 0.0
        self.press_bar += 0.01 * (60.0 if pressing else -300.0 * (self._pedals.tilt > 0.0 or self.bucket_rad > -0.83))
        self.press_bar = min(max(self.press_bar, 8.0), 90.0)
        self.now_ns += STEP_NS
        if self.guided and self.now_ns % 100_000_000 == 0:
            walls = self._walls_m
            near = walls[np.hypot(*(walls - self.truth.state[:2]).T) < 12.0]
            self.rooms_m.append(room(self.truth.state, near))
            self.speeds_mps.append(self.truth.speed)

    def _follow(self, directive: Directive, step_s: float) -> None:
        """Run along the path, the joint straight."""
        lead = lead_of(directive.gear, MODEL, BODIES)
        x, y, *_ = lead.state(self.motion())
        path = directive.path
        near = int(np.hypot(path[:, 0] - x, path[:, 1] - y).argmin())
        c, s = math.cos(path[near, HEADING]), math.sin(path[near, HEADING])
        at = float(path[near, WAY] + c * (x - path[near, 0]) + s * (y - path[near, 1]))
        before = directive.gear * self.truth.speed
        left = max(directive.stop_m - at, 0.0)
        speed = min(float(path[near, SPEED]), max(before, 0.0) + 1.0 * step_s, math.sqrt(1.2 * left), left / step_s)
        at += speed * step_s
        x, y, heading = (float(np.interp(at, path[:, WAY], path[:, k])) for k in (0, 1, HEADING))
        x, y, heading = lead.base((x, y, heading, 0.0, 0.0))
        self.truth.state = np.array([x, y, float(se2.wrap(heading)), 0.0, 0.0])
        self.truth.speed = directive.gear * (speed if left > 0.02 else 0.0)

    def motion(self) -> Motion:
        x, y, heading, bend, rate = self.truth.state.tolist()
        return Motion(self.now_ns, x, y, heading, bend, rate, self.truth.speed)

    def signals(self) -> Signals:
        noise = self._rng.standard_normal(4).tolist()
        return Signals(
            self.now_ns, self.truth.speed, self.truth.speed, self.now_ns, self._travel_m, self.boom_rad,
            self.bucket_rad, float(self.truth.state[3]), 60.0 + noise[0], 80.0 + noise[1], self.press_bar + 0.3 * noise[2],
        )  # fmt: skip


def bench(
    *, drift: Drift | None = None, start: Sequence[float] = (5.0, 0.0, 0.0), fill: float = 0.9, **more: Any
) -> Bench:
    """A bench with simple controllers."""
    settings = more.pop("settings", LoadingSettings())
    rule = more.pop("rule", Until())
    task = LoadingTask(MODEL, BODIES, more.pop("controllers", None) or controllers(fill), rule, settings)
    return Bench(drift or Drift(), task, np.array(start), **more)
