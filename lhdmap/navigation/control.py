"""Navigation control: drives the legs of a route one after the other, and says what it does and why.

planning -> driving -> resting (a change of gear) -> driving … -> arrived
               | stuck: backing, and another try, at most twice; then assistance
               | way closed: planning again     | place not known, overrun: assistance
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.errors import UsageError
from lhdmap.geometry import se2
from lhdmap.guidance.directive import Directive, moved
from lhdmap.messages import FloatArray
from lhdmap.movement.route import Route
from lhdmap.movement.routes import RouteOptions, RoutePlanner
from lhdmap.navigation.goals import Approach, overrun, reached
from lhdmap.navigation.leg import Leg, legs_of
from lhdmap.navigation.room import with_room
from lhdmap.navigation.settings import NavigationSettings
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel, Waypoint

IDLE, DRIVING, RESTING, BACKING, ARRIVED, ASSISTANCE = "idle", "driving", "resting", "backing", "arrived", "assistance"
_BEHIND_M, _AHEAD_M = 12.0, 60.0
_SECOND_NS = 1_000_000_000
_STUCK_RESET_M = 8.0


class Located(NamedTuple):
    """Where the machine is: `status` as in localization, the same place in both frames (3,), covariance (3, 3) in `map`."""

    stamp_ns: int
    status: str
    pose_map: FloatArray
    pose_odom: FloatArray
    covariance: FloatArray
    height_m: float


Say = Callable[..., None]
"""`say(state, cause, **values)`: told of each change of state (`lhdmap.replay.journal.Scribe.goes`)."""


class NavigationControl:
    """Takes a goal; `step` gives the directive of now, None where the machine is to stand."""

    def __init__(
        self, planner: RoutePlanner, model: DriveModel, bodies: Bodies, settings: NavigationSettings, say: Say
    ) -> None:
        self._planner, self._model, self._settings, self._say = planner, model, settings, say
        self._nose_m = float(bodies.front_m[:, 0].max())
        self._tail_m = model.wheelbase_m - float(bodies.rear_m[:, 0].min())
        self._leads = {gear: lead_of(gear, model, bodies) for gear in (1, -1)}
        self.state = IDLE
        self.reason = ""
        self.goal = ""
        self.legs: list[Leg] = []
        self.leg = 0
        self.may_move = True  # whether the machine is armed: one that is not does not move, and is not stuck
        self.closed: tuple[str, ...] = ()
        self._target = 0
        self._since_ns = 0
        self._tries = 0
        self._tried_at_m = -math.inf
        self._backing: tuple[Leg, float] | None = None
        self._driven_m = 0.0
        self._before: FloatArray | None = None
        self._at_m = 0.0

    def go(self, start: str, goal: str, located: Located, *, loaded: bool = False) -> None:
        """Plan to a goal from a place of the map where the machine stands; raises UsageError where a name is wrong."""
        heading = math.degrees(float(located.pose_map[2]))
        topology = self._planner.topology
        asked = RouteOptions(heading=f"{heading:.1f}", goal_heading=facing(topology, goal), alternatives=0)

        def ask(avoid: tuple[str, ...]) -> Route:
            return self._planner.route(start, goal, replace(asked, avoid=avoid))

        route = with_room(topology, ask, self.closed, self._nose_m, self._tail_m, self._settings.room_m)
        self.goal = goal
        if not route.feasible:
            self._ask(f"no route: {route.reason}")
            return
        self.legs = legs_of(topology, route, self._model.wheelbase_m, self._nose_m, self._settings, loaded=loaded)
        self.leg, self._target, self._tries = 0, 0, 0
        if not self.legs:
            self._goes(ARRIVED, "already there")
            return
        self._goes(
            DRIVING, "route", goal=goal, legs=len(self.legs), distance_m=route.distance_m, gear=self.legs[0].gear
        )

    def close(self, way: str) -> None:
        """Count a way (a name, or `A:B`) as closed from now on; a route over it is planned again at the next step."""
        self.closed = (*self.closed, way)

    def step(self, now_ns: int, motion: Motion, located: Located) -> Directive | None:
        """Return the directive of now."""
        self._count(motion)
        if self.state in (IDLE, ARRIVED, ASSISTANCE):
            return None
        deviation = math.sqrt(max(float(np.linalg.eigvalsh(located.covariance[:2, :2])[-1]), 0.0))
        if located.status != "tracking" or deviation > self._settings.believe_m:
            self._ask(f"place not known: {located.status}, deviation {deviation:.2f} m")
            return None
        standing = abs(motion.speed_mps) < self._settings.standing_mps
        if self.state == RESTING:
            self._rest(now_ns)
            return None
        if self.state == BACKING:
            return self._back(now_ns, motion, located, standing)
        return self._drive(now_ns, motion, located, standing)

    def _drive(self, now_ns: int, motion: Motion, located: Located, standing: bool) -> Directive | None:
        leg = self.legs[self.leg]
        T_odom_map = se2.compose(located.pose_odom, se2.inverse(located.pose_map))
        path = moved(leg.path, T_odom_map)
        lead = self._leads[leg.gear].state(motion)
        self._at_m = _at_m(path, lead[0], lead[1])
        left_m = leg.stop_m - self._at_m
        self._pass_targets(leg, motion, located)
        if self._missed(leg):
            self._ask("overrun: the tunnel's end was missed")
            return None
        if standing and abs(left_m) < self._settings.arrived_m:
            self._stopped(now_ns, leg)
            return None
        if not standing or self._since_ns == 0 or not self.may_move:
            self._since_ns = now_ns
        if (now_ns - self._since_ns) * 1e-9 > self._settings.stuck_s:
            self._stuck(leg, left_m)
            return None
        return _cut(now_ns, leg.gear, path, leg.stop_m, self._at_m)

    def _pass_targets(self, leg: Leg, motion: Motion, located: Located) -> None:
        """Say which targets are reached, one after the other, before the machine is there."""
        while self._target < len(leg.targets) - 1:
            target = leg.targets[self._target]
            approach = self._approach(leg, target.pose, motion, located)
            if not reached(approach, self._settings, crossing=target.crossing) and self._at_m < target.at_m + 3.0:
                return
            self._target += 1
            self._driven_m = 0.0
            self._say(DRIVING, "target", point=target.point, node=leg.targets[self._target].node)

    def _approach(self, leg: Leg, pose: FloatArray, motion: Motion, located: Located) -> Approach:
        lead = self._leads[leg.gear]
        x, y, heading, _, _ = lead.state(_on_map(motion, located))
        offset = pose[:2] - np.array([x, y])
        far = max(float(np.linalg.norm(offset)), 1e-6)
        speed = lead.speed_mps(motion)
        closing = speed * float(offset @ np.array([math.cos(heading), math.sin(heading)])) / far
        course = pose[3] if math.cos(pose[3] - heading) > 0.0 else pose[3] + math.pi
        return Approach(offset, located.covariance[:2, :2], closing, heading - course)

    def _missed(self, leg: Leg) -> bool:
        """Return whether the odometry has gone much farther than the node of the target is long."""
        before = leg.targets[self._target - 1].at_m if self._target > 0 else 0.0
        length = (
            max(leg.targets[self._target].at_m, leg.stop_m if self._target == len(leg.targets) - 1 else 0.0) - before
        )
        return overrun(self._driven_m, length, self._settings)

    def _stopped(self, now_ns: int, leg: Leg) -> None:
        self.leg += 1
        self._target, self._tries, self._driven_m = 0, 0, 0.0
        self._since_ns = now_ns
        if self.leg == len(self.legs):
            self._goes(ARRIVED, "stop", goal=self.goal)
        else:
            self._goes(RESTING, "inversion" if leg.inversion else "stop", gear=self.legs[self.leg].gear)

    def _rest(self, now_ns: int) -> None:
        if (now_ns - self._since_ns) * 1e-9 >= self._settings.inversion_s:
            self._since_ns = 0
            self._goes(DRIVING, "rested", gear=self.legs[self.leg].gear)

    def _stuck(self, leg: Leg, left_m: float) -> None:
        """Back up and try again, at most so often at one place; then ask."""
        if self._at_m > self._tried_at_m + _STUCK_RESET_M:
            self._tries = 0
        if self._tries >= self._settings.back_ups:
            self._ask(f"stuck {left_m:.1f} m before the stop, tried {self._tries + 1} times")
            return
        self._tries += 1
        self._tried_at_m = self._at_m
        wheelbase = self._model.wheelbase_m
        back = leg.path[::-1].copy()
        back[:, 2] += math.pi
        back[:, 5] = leg.path[-1, 5] - leg.path[::-1, 5]
        begin = back[-1, 5] - self._at_m + wheelbase  # the other axle leads, a wheelbase behind
        self._backing = Leg(-leg.gear, back, begin + self._settings.back_up_m, begin, (), True), self._at_m
        self._since_ns = 0
        self._goes(BACKING, "stuck", at_m=self._at_m, left_m=left_m, tries=self._tries)

    def _back(self, now_ns: int, motion: Motion, located: Located, standing: bool) -> Directive | None:
        assert self._backing is not None  # noqa: S101  # in this state
        leg, _ = self._backing
        path = moved(leg.path, se2.compose(located.pose_odom, se2.inverse(located.pose_map)))
        lead = self._leads[leg.gear].state(motion)
        at_m = _at_m(path, lead[0], lead[1])
        if not standing or self._since_ns == 0 or not self.may_move:
            self._since_ns = now_ns
        waited = (now_ns - self._since_ns) * 1e-9 > self._settings.stuck_s
        if standing and (abs(leg.stop_m - at_m) < self._settings.arrived_m or waited):
            self._since_ns = 0
            self._goes(DRIVING, "backed up", gear=self.legs[self.leg].gear)
            return None
        return _cut(now_ns, leg.gear, path, min(leg.stop_m, float(path[-1, 5]) - 1.0), at_m)

    def _count(self, motion: Motion) -> None:
        place = np.array([motion.x_m, motion.y_m])
        if self._before is not None:
            step_m = float(np.linalg.norm(place - self._before))
            self._driven_m += -step_m if self.state == BACKING else step_m  # what is backed up is driven again
        self._before = place

    def _ask(self, why: str) -> None:
        self.reason = why
        self._goes(ASSISTANCE, why)

    def _goes(self, state: str, cause: str, **values: Any) -> None:
        self.state = state
        self._say(state, cause, **values)


def _on_map(motion: Motion, located: Located) -> Motion:
    """Return a motion with its place in `map`."""
    T_map_odom = se2.compose(located.pose_map, se2.inverse(located.pose_odom))
    x, y, heading = se2.compose(T_map_odom, np.array([motion.x_m, motion.y_m, motion.heading_rad])).tolist()
    return motion._replace(x_m=x, y_m=y, heading_rad=heading)


def _at_m(path: FloatArray, x: float, y: float) -> float:
    """Return how far along a path a place is."""
    near = int(np.hypot(path[:, 0] - x, path[:, 1] - y).argmin())
    heading = path[near, 2]
    ahead = math.cos(heading) * (x - path[near, 0]) + math.sin(heading) * (y - path[near, 1])
    return float(path[near, 5] + ahead)


def _cut(now_ns: int, gear: int, path: FloatArray, stop_m: float, at_m: float) -> Directive:
    """Return the directive with the part of a path around a place."""
    part = (path[:, 5] > at_m - _BEHIND_M) & (path[:, 5] < at_m + _AHEAD_M)
    return Directive(now_ns, gear, path[part], stop_m)


def facing(topology: TopologicalMap, goal: str) -> str | None:
    """Return the heading at a goal: a draw point or a dump at a dead end is faced with the bucket; None: any will do."""
    point = topology.called(goal)
    if not isinstance(point, Waypoint) or point.purpose not in ("draw_point", "dump"):
        return None
    node = topology.nodes[point.node]
    if not isinstance(node, Tunnel) or DEAD_END not in node.ends:
        return None
    return "along" if node.ends[1] == DEAD_END else "against"


def checked(planner: RoutePlanner, name: str) -> str:
    """Return a name of the map; raises UsageError where nothing has it."""
    if planner.topology.called(name) is None:
        raise UsageError(f"'{name}': no such place in the map")
    return name
