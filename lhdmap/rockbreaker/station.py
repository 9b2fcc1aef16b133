"""The station at a grizzly: what it sees, in which order it goes to the rocks, and how it gets to the next one.

It is asked again after each blow with a new cloud, so that a rock that only cracked, rolled or left large pieces is found
again like any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.collision import Obstacles, without_arm
from lhdmap.rockbreaker.kinematics import theta_of_pose
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.order import best_order, order_s
from lhdmap.rockbreaker.paths import Kind
from lhdmap.rockbreaker.plan import Plan, Planner, Request
from lhdmap.rockbreaker.rocks import Rock, Scene, find_rocks
from lhdmap.rockbreaker.settings import RockbreakerSettings
from lhdmap.rockbreaker.timing import Timing

_SAME_M, _SAME_SIZE = (
    0.12,
    0.2,
)  # how far a rock that nobody touched may be from where it was seen before, and its size's share
_LEVEL_M = 0.01  # nearer to a height there is no step to it
_CUBE_M = 0.04  # of the cloud that must not be touched one point in each such cube is kept
_ASIDE_M = 0.15  # around a rock that the tip goes down to nothing of the cloud is in the way
_KINDS: tuple[Kind, ...] = ("dsjm", "cslm")


@dataclass(frozen=True, slots=True)
class Pose:
    """Tip (3,), metres, and orientation of the breaker, radians."""

    tip_m: FloatArray
    phi: float

    def theta(self, machine: Rockbreaker) -> FloatArray:
        """Return the joints (4,), NaN out of reach."""
        return theta_of_pose(machine, np.append(self.tip_m, self.phi))


@dataclass(frozen=True, slots=True)
class Decision:
    """What to do next: moves one after the other, then a blow where there is a `rock`, then `lift`; without moves nothing.

    `order` are all rocks in the order of least time, `order_s` the time of the moves between them and back to where the tip waits.
    """

    scene: Scene
    moves: tuple[Plan, ...] = ()
    rock: Rock | None = None
    lift: Plan | None = None
    order: tuple[Rock, ...] = ()
    order_s: float = 0.0
    stuck: str = ""


@dataclass
class Station:
    """Decides for one machine; a rock is broken where its middle dimension is larger than an opening less `margin_m`."""

    machine: Rockbreaker
    settings: RockbreakerSettings = field(default_factory=RockbreakerSettings)
    timing: Timing = "smooth"
    margin_m: float = 0.05
    most_blows: int = 12
    work_plane_m: float = -math.inf
    known: list[Rock] = field(default_factory=list)
    struck: list[Rock] = field(default_factory=list)
    _times_s: dict[tuple[float, ...], float] = field(default_factory=dict)

    def decide(self, points_m: FloatArray, at: Pose) -> Decision:
        """Return what to do next, from the cloud (N, 3) of now and where the tip is.

        Raises:
            InputError: the cloud shows no grizzly.
        """
        points_m = without_arm(self.machine, points_m, at.theta(self.machine))
        scene = find_rocks(points_m, self.machine.grizzly)
        self.known = [self._recognized(one) for one in scene.oversize(self.machine.grizzly.opening_m - self.margin_m)]
        self._raise_plane(scene)
        obstacles_m = _thinned(points_m)
        left = [one for one in self.known if self._blows(one) < self.most_blows]
        if not left:
            stuck = f"{len(self.known)} rocks do not break" if self.known else ""
            return replace(self._home(scene, obstacles_m, at), stuck=stuck)
        order, total_s = self.best(at, left)
        for rock in order:
            found = self._towards(scene, obstacles_m, at, rock)
            if found is not None:
                self.struck.append(rock)
                return replace(found, order=order, order_s=total_s)
        return replace(self._home(scene, obstacles_m, at), stuck=f"none of {len(left)} rocks can be reached")

    def best(self, at: Pose, rocks: Sequence[Rock]) -> tuple[tuple[Rock, ...], float]:
        """Return the rocks in the order of least time from a pose over all of them to where the tip waits, and that time."""
        tops = [one.top_m for one in rocks]
        start_s = np.array([self.between_s(at.tip_m, top) for top in tops])
        between_s = np.array([[0.0 if a is b else self.between_s(a, b) for b in tops] for a in tops])
        end_s = np.array([self.between_s(top, self.park_m) for top in tops])
        order = best_order(start_s, between_s, end_s)
        return tuple(rocks[k] for k in order), order_s(order, start_s, between_s, end_s)

    @property
    def park_m(self) -> FloatArray:
        """Where the tip waits (3,)."""
        return np.array(self.machine.base.park_m)

    def between_s(self, a_m: FloatArray, b_m: FloatArray) -> float:
        """Return the time of the faster level path between above two places, infinite where there is none."""
        key = (*np.round(a_m[:2], 3).tolist(), *np.round(b_m[:2], 3).tolist())
        if key not in self._times_s:
            planner = Planner(self.machine, self.settings)
            level = [np.array([*one[:2], self.work_plane_m]) for one in (a_m, b_m)]
            plans = [planner.plan(Request(level[0], level[1], path=kind, timing=self.timing)) for kind in _KINDS]
            self._times_s[key] = min(_duration_s(plan) for plan in plans)
        return self._times_s[key]

    def _raise_plane(self, scene: Scene) -> None:
        """Raise the work plane where a rock stands higher than before; it never falls, so that times stay true."""
        bars_m = scene.height_m(float(self.park_m[0]), float(self.park_m[1]))
        needed_m = max((float(one.top_m[2]) for one in scene.rocks), default=bars_m) + self.settings.clearance_m
        if needed_m > self.work_plane_m:
            self.work_plane_m = needed_m
            self._times_s.clear()

    def _recognized(self, rock: Rock) -> Rock:
        """Return the rock as it was seen before, if it is still the same: times to it are known then."""
        for one in self.known:
            same = np.hypot(*(one.top_m - rock.top_m)[:2]) < _SAME_M
            if same and abs(one.size_m - rock.size_m) < _SAME_SIZE * one.size_m:
                return one
        return rock

    def _blows(self, rock: Rock) -> int:
        return sum(one is rock for one in self.struck)

    def _towards(self, scene: Scene, obstacles_m: FloatArray, at: Pose, rock: Rock) -> Decision | None:
        """Return the way to a rock and up again, None where it cannot be reached."""
        planner = self._planner(obstacles_m)
        moves = self._over(planner, at, rock.top_m)
        if moves is None:
            return None
        above = _end(moves, at)
        aside = np.hypot(*(obstacles_m - rock.top_m)[:, :2].T) > 0.5 * rock.length_m + _ASIDE_M
        planner = self._planner(obstacles_m[aside])
        down = self._upright(planner, above, float(rock.top_m[2]))
        if down.trajectory is None:
            return None
        lift = self._upright(planner, _end((down,), above), self.work_plane_m)
        return None if lift.trajectory is None else Decision(scene, (*moves, down), rock, lift)

    def _over(self, planner: Planner, at: Pose, to_m: FloatArray) -> tuple[Plan, ...] | None:
        """Return the steps to above a place: straight up or down to the work plane, then level by the faster path."""
        moves: tuple[Plan, ...] = ()
        if abs(float(at.tip_m[2]) - self.work_plane_m) > _LEVEL_M:
            moves = (self._upright(planner, at, self.work_plane_m),)
            if moves[0].trajectory is None:
                return None
            at = _end(moves, at)
        goal_m = np.array([*to_m[:2], self.work_plane_m])
        if np.hypot(*(goal_m - at.tip_m)[:2]) < _LEVEL_M:
            return moves
        ways = [planner.plan(Request(at.tip_m, goal_m, at.phi, path=kind, timing=self.timing)) for kind in _KINDS]
        best = min(ways, key=_duration_s)
        return None if best.trajectory is None else (*moves, best)

    def _upright(self, planner: Planner, at: Pose, z_m: float) -> Plan:
        return planner.plan(Request(at.tip_m, np.array([*at.tip_m[:2], z_m]), at.phi, path="cslm", timing=self.timing))

    def _home(self, scene: Scene, obstacles_m: FloatArray, at: Pose) -> Decision:
        """Return the way back to where the tip waits; no moves where it is there."""
        if np.linalg.norm(at.tip_m - self.park_m) < _LEVEL_M:
            return Decision(scene)
        planner = self._planner(obstacles_m)
        moves = self._over(planner, at, self.park_m)
        if moves is None:
            return Decision(scene, stuck="there is no way back to where the tip waits")
        last = self._upright(planner, _end(moves, at), float(self.park_m[2]))
        return Decision(scene, moves if last.trajectory is None else (*moves, last))

    def _planner(self, obstacles_m: FloatArray) -> Planner:
        return Planner(self.machine, self.settings, Obstacles(points_m=obstacles_m))


def _duration_s(plan: Plan) -> float:
    return math.inf if plan.trajectory is None else plan.trajectory.law.duration_s


def _end(moves: Sequence[Plan], at: Pose) -> Pose:
    return Pose(moves[-1].request.end_m, moves[-1].phi_to) if moves else at


def _thinned(points_m: FloatArray) -> FloatArray:
    finite = points_m[np.isfinite(points_m).all(axis=1)]
    cells = np.floor(finite / _CUBE_M).astype(np.int64)
    _, first = np.unique(cells @ np.array([1 << 40, 1 << 20, 1]), return_index=True)  # each cube in 20 bits an axis
    return finite[np.sort(first)]
