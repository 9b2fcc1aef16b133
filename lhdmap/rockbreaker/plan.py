"""From two tips to a timed, checked trajectory."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker import corridor, turning
from lhdmap.rockbreaker.collision import Obstacles
from lhdmap.rockbreaker.corridor import Refusal
from lhdmap.rockbreaker.cylinders import rho_of_theta
from lhdmap.rockbreaker.flow import FlowCurve, flow_curve, least_duration_s
from lhdmap.rockbreaker.kinematics import theta_of_pose
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import nearest_vertical, phi_intervals, planar_position, unwrapped
from lhdmap.rockbreaker.paths import Kind, Path
from lhdmap.rockbreaker.settings import RockbreakerSettings
from lhdmap.rockbreaker.timing import TIMINGS, TimeLaw, Timing
from lhdmap.rockbreaker.validation import validated

GRID = np.linspace(0.0, 1.0, 2001)  # σ at which limits are evaluated for timing
FINE_GRID = np.linspace(0.0, 1.0, 8001)  # the same where the breaker's turning has blends, which may be narrow
_PEAKS = 40  # of the load over time, around which it is looked at more closely


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked for: two tips (3,), metres; orientations in radians, NaN: by Section 3.1; path and timing."""

    start_m: FloatArray
    end_m: FloatArray
    phi_from: float = math.nan
    phi_to: float = math.nan
    path: Kind = "dsjm"
    timing: Timing = "paper"


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A timed path: its limits over σ, the law σ(t), the least clearance to obstacles, and the bound from below for any path."""

    path: Path
    timing: Timing
    law: TimeLaw
    curve: FlowCurve
    clearance_m: float
    bound_s: float

    @property
    def pump_volume_l(self) -> float:
        """Oil that the pump delivers along the path, whatever its timing, litres."""
        flow = self.curve.loads[:, 4] * self.path.machine.flow_limits_m3ps[4]
        return 1e3 * float(np.trapezoid(flow, self.curve.sigma))

    def way_m(self) -> FloatArray:
        """Return the tip along the path (101, 3)."""
        return self.path.tip(np.linspace(0.0, 1.0, 101))


@dataclass(frozen=True, slots=True)
class Plan:
    """What was asked for, the orientations at its ends, and either a trajectory or the reason why there is none."""

    request: Request
    phi_from: float
    phi_to: float
    planning_ms: float
    refusal: Refusal | None = None
    trajectory: Trajectory | None = None


@dataclass(frozen=True, slots=True)
class Planner:
    """Plans for one machine; `obstacles` are what its links must not touch."""

    machine: Rockbreaker = field(default_factory=Rockbreaker)
    settings: RockbreakerSettings = field(default_factory=RockbreakerSettings)
    obstacles: Obstacles = field(default_factory=Obstacles)

    def plan(self, request: Request) -> Plan:
        """Return the trajectory for a request, or why there is none: orientations, path, validation, collisions, timing."""
        begun = time.perf_counter()
        phi_from = self._phi(request.start_m, request.phi_from)
        phi_to = self._phi(request.end_m, request.phi_to)
        path = self._path(request, phi_from, phi_to)
        found = path if isinstance(path, Refusal) else self._timed(path, request.timing)
        refusal, trajectory = (found, None) if isinstance(found, Refusal) else (None, found)
        return Plan(request, phi_from, phi_to, 1e3 * (time.perf_counter() - begun), refusal, trajectory)

    def warm_up(self, request: Request) -> None:
        """Plan once in vain, so that compiled code is loaded and the next `planning_ms` says what planning takes."""
        tip = np.array([0.6, 0.0, -0.1]) * self.machine.links_m.sum()
        self.plan(
            replace(request, start_m=tip, end_m=tip + np.array([0.1, 0.1, 0.0]), phi_from=math.nan, phi_to=math.nan)
        )
        self.plan(request)

    def _timed(self, path: Path, timing: Timing) -> Trajectory | Refusal:
        """Return the path with its timing, or what the links would touch."""
        contact = self.obstacles.first_contact(path)
        if contact.refusal is not None:
            return contact.refusal
        curve = flow_curve(path, GRID if len(path.turning.sigma) == 2 else FINE_GRID)
        law = _within_limits(path, TIMINGS[timing](curve, self.settings.min_ramp_s))
        rho = rho_of_theta(self.machine, path.theta(np.array([0.0, 1.0])))
        bound_s = least_duration_s(self.machine, rho[0], rho[1])
        return Trajectory(path, timing, law, curve, contact.clearance_m, bound_s)

    def _phi(self, tip_m: FloatArray, given: float) -> float:
        if math.isnan(given):
            return nearest_vertical(self.machine, tip_m)
        return float(unwrapped(self.machine, np.asarray(given)))

    def _path(self, request: Request, phi_from: float, phi_to: float) -> Path | Refusal:
        """Return the path with a feasible turning, or why an end or the way between them is not feasible."""
        line = turning.straight(phi_from, phi_to)
        path = Path(self.machine, request.path, request.start_m, request.end_m, line)
        for sigma, phi in ((0.0, phi_from), (1.0, phi_to)):
            refusal = self._end_refusal(path, sigma, phi)
            if refusal is not None:
                return refusal
        return validated(path, self.settings)

    def _end_refusal(self, path: Path, sigma: float, phi: float) -> Refusal | None:
        """Return why the pose at an end is not feasible, if it is not."""
        place = np.array([sigma])
        if math.isnan(phi):
            return corridor.out_of_reach(path, sigma)
        theta = path.theta(place)[0]
        intervals = phi_intervals(self.machine, planar_position(path.tip(place)[0]))
        low, high = self.machine.theta_limits[:, 0]
        if corridor.contains(intervals, phi) and low - 1e-9 <= theta[0] <= high + 1e-9:
            return None
        refusal = corridor.violated(self.machine, theta, sigma)
        if refusal.joint == "theta1":
            return refusal
        possible = [f"{a:.2f} to {b:.2f}" for a, b in np.degrees(intervals[~np.isnan(intervals[:, 0])])]
        return replace(refusal, limit=f"{refusal.limit} (phi there: {', '.join(possible) or 'no'} deg)")


def start_joints(machine: Rockbreaker, request: Request) -> FloatArray:
    """Return θ (4,) at the start of a request, NaN where the tip or its orientation is out of reach."""
    phi = nearest_vertical(machine, request.start_m) if math.isnan(request.phi_from) else request.phi_from
    return theta_of_pose(machine, np.append(request.start_m, phi))


def _within_limits(path: Path, law: TimeLaw) -> TimeLaw:
    """Slow the law down by what the limits are exceeded by between the nodes of the grid that it was made on."""
    t, step_s = np.linspace(0.0, law.duration_s, 6001, retstep=True)
    load = _load(path, law, t)
    peaks = np.argsort(-load)[:_PEAKS]
    near = (t[peaks, None] + step_s * np.linspace(-1.0, 1.0, 21)).ravel()
    excess = max(float(load.max()), float(_load(path, law, np.clip(near, 0.0, law.duration_s)).max()))
    return law.slower(excess) if excess > 1.0 else law


def _load(path: Path, law: TimeLaw, t_s: FloatArray) -> FloatArray:
    """Return σ̇ over the highest that the limits allow (N,) at times (N,)."""
    sigma, rate = law(t_s)
    return np.asarray(rate / flow_curve(path, sigma).highest)
