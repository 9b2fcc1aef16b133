"""Navigation control: drives the legs of a route one after the other, and says what it does and why.

planning -> driving -> resting (a change of gear) -> driving … -> arrived
               | stuck: backing, and another try, at most twice; then the way is closed, and another route is planned
               | place not known: halted, on from there once it is known again
             | the next node may not be entered yet: waiting before it, on once it may
               | no other route, place not known for long, overrun: assistance, until the station says to go on
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import WAY, Directive, moved
from lhdmap.messages import FloatArray
from lhdmap.movement.routes import RoutePlanner
from lhdmap.navigation.along import Located, along_m, on_map, part_of
from lhdmap.navigation.begin import Begin, Errand, Reach, begins_at, best_begin, passed_by, route_from
from lhdmap.navigation.goals import Approach, overrun, reached
from lhdmap.navigation.hold import ROOM_M, hold_of
from lhdmap.navigation.leg import Leg, legs_of
from lhdmap.navigation.settings import NavigationSettings

IDLE, DRIVING, RESTING, BACKING, ARRIVED, ASSISTANCE = "idle", "driving", "resting", "backing", "arrived", "assistance"
HALTED, WAITING = "halted", "waiting"
_HELD_M = 1.0  # a machine that stands so near its hold waits for it
_STUCK_RESET_M = 8.0


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
        self.avoid: tuple[
            str, ...
        ] = ()  # nodes (ids) that routes touch only where they begin or end: others come there
        self.free: Collection[str] | None = None  # nodes (ids) that may be entered; None: all
        self._target = 0
        self._since_ns = 0
        self._tries = 0
        self._tried_at_m = -math.inf
        self._backing: tuple[Leg, float] | None = None
        self._driven_m = self._speed_mps = 0.0
        self._before: FloatArray | None = None
        self._at_m = 0.0
        self._begun_m: float | None = None  # where along its path the leg was begun
        self._loaded = False
        self.sight_m = math.inf  # how far the path ahead is seen free, as guidance tells

    def go(self, start: str, goal: str, located: Located, *, loaded: bool = False) -> None:
        """Plan to a goal from a point of the map, empty: from where the machine is; raises UsageError where a name is wrong."""
        self.goal, self._loaded = goal, loaded
        place = np.append(located.pose_map[:2], located.height_m)
        begins = [Begin(start, 0.0)] if start else begins_at(self._planner.topology, place, goal)
        self._plan(begins, located)

    def go_on(self, located: Located, *, reopened: bool = False) -> None:
        """Plan again from where the machine is, after others drove it or helped; `reopened`: what was closed is open again."""
        self.closed = () if reopened else self.closed
        if self.state not in (IDLE, ARRIVED) and self.goal:
            self.go("", self.goal, located, loaded=self._loaded)

    def close(self, way: str) -> None:
        """Count a way (a name, or `A:B`) as closed from now on, for routes that are planned then."""
        self.closed = (*self.closed, way)

    def _plan(self, begins: list[Begin], located: Located) -> None:
        """Plan to the goal from one of several points; ask for help where nothing leads there."""
        topology, settings = self._planner.topology, self._settings
        if not begins:
            self._ask("no route: there is no point of the map near")
            return
        errand = Errand(
            self.goal, float(located.pose_map[2]), (*passed_by(topology, self.avoid, begins, self.goal), *self.closed)
        )
        body = Reach(self._nose_m, self._tail_m, settings.room_m)
        begin, route = best_begin(begins, lambda point: route_from(self._planner, point, errand, body))
        if not route.feasible:
            self._ask(f"no route: {route.reason}")
            return
        wheelbase_m = self._model.wheelbase_m
        away = {"away_m": begin.away_m}
        self.legs = legs_of(topology, route, wheelbase_m, self._nose_m, settings, loaded=self._loaded, **away)
        self.leg, self._target, self._tries, self._driven_m, self._since_ns = 0, 0, 0, 0.0, 0
        self._tried_at_m, self._begun_m = -math.inf, None
        if not self.legs:
            self._goes(ARRIVED, "already there")
            return
        if self.legs[0].gear * self._speed_mps < -self._settings.standing_mps:
            self._goes(RESTING, "the other gear", gear=self.legs[0].gear)
            return
        told = {"legs": len(self.legs), "distance_m": route.distance_m, "gear": self.legs[0].gear, "begin": begin.point}
        self._goes(DRIVING, "route", goal=self.goal, **told)

    def step(self, now_ns: int, motion: Motion, located: Located) -> Directive | None:
        """Return the directive of now."""
        self._count(motion)
        if self.state in (IDLE, ARRIVED, ASSISTANCE):
            return None
        standing = abs(motion.speed_mps) < self._settings.standing_mps
        if self.state == HALTED or not self.knows(located):
            self._halt(now_ns, located, standing=standing)
            return None
        if self.state == RESTING:
            self._rest(now_ns, standing=standing)
            return None
        if self.state == BACKING:
            return self._back(now_ns, motion, located, standing)
        return self._drive(now_ns, motion, located, standing)

    @property
    def left_m(self) -> float:
        """Way to the end of the last leg; infinite where there is none."""
        if self.state not in (DRIVING, WAITING, RESTING, BACKING, HALTED) or not self.legs:
            return math.inf
        rest_m = sum(leg.stop_m - float(leg.path[0, WAY]) for leg in self.legs[self.leg + 1 :])
        return self.legs[self.leg].stop_m - self._at_m + rest_m

    def knows(self, located: Located) -> bool:
        """Return whether a place is good enough to drive by."""
        return located.status == "tracking" and located.deviation_m <= self._settings.believe_m

    def _drive(self, now_ns: int, motion: Motion, located: Located, standing: bool) -> Directive | None:
        leg = self.legs[self.leg]
        path = moved(leg.path, located.T_odom_map)
        lead = self._leads[leg.gear].state(motion)
        self._at_m = along_m(path, lead[0], lead[1])
        self._begun_m = self._at_m if self._begun_m is None else self._begun_m
        left_m = leg.stop_m - self._at_m
        self._pass_targets(leg, motion, located)
        if self._missed(leg):
            self._ask("overrun: the tunnel's end was missed")
            return None
        if standing and abs(left_m) < self._settings.arrived_m:
            self._stopped(now_ns, leg)
            return None
        hold = hold_of(self._planner.topology, leg, self._at_m, self.free, self._reach_m(leg.gear))
        if hold.stop_m < leg.stop_m and standing and self._at_m > hold.stop_m - _HELD_M:
            self._since_ns = now_ns
            self._goes(WAITING, "the next node is not free", node=hold.node)
            return None
        if self.state == WAITING:
            self._goes(DRIVING, "the next node is free")
        if not standing or self._since_ns == 0 or not self.may_move:
            self._since_ns = now_ns
        if (now_ns - self._since_ns) * 1e-9 > self._patience_s():
            self._stuck(leg, left_m, located)
            return None
        return part_of(now_ns, leg.gear, path, min(leg.stop_m, hold.stop_m), self._at_m)

    def _reach_m(self, gear: int) -> float:
        """Return how far the machine reaches before its leading axle, and the room kept before a node that is not free."""
        return (self._nose_m if gear > 0 else self._tail_m - self._model.wheelbase_m) + ROOM_M

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
        x, y, heading, _, _ = lead.state(on_map(motion, located))
        offset = pose[:2] - np.array([x, y])
        far = max(float(np.linalg.norm(offset)), 1e-6)
        speed = lead.speed_mps(motion)
        closing = speed * float(offset @ np.array([math.cos(heading), math.sin(heading)])) / far
        course = pose[3] if math.cos(pose[3] - heading) > 0.0 else pose[3] + math.pi
        return Approach(offset, located.covariance[:2, :2], closing, heading - course)

    def _missed(self, leg: Leg) -> bool:
        """Return whether the odometry has gone much farther than the node of the target is long."""
        before = leg.targets[self._target - 1].at_m if self._target > 0 else self._begun_m or 0.0
        length = (
            max(leg.targets[self._target].at_m, leg.stop_m if self._target == len(leg.targets) - 1 else 0.0) - before
        )
        return overrun(self._driven_m, length, self._settings)

    def _stopped(self, now_ns: int, leg: Leg) -> None:
        self.leg += 1
        self._target, self._tries, self._driven_m, self._begun_m = 0, 0, 0.0, None
        self._since_ns = now_ns
        if self.leg == len(self.legs):
            self._goes(ARRIVED, "stop", goal=self.goal)
        else:
            self._goes(RESTING, "inversion" if leg.inversion else "stop", gear=self.legs[self.leg].gear)

    def _halt(self, now_ns: int, located: Located, *, standing: bool) -> None:
        """Stand where the place is not known; go on from there once it is, or ask after some time."""
        settings, why = self._settings, f"{located.status}, deviation {located.deviation_m:.2f} m"
        if self.state != HALTED:
            self._since_ns = now_ns
            self._goes(HALTED, f"place not known: {why}")
        elif self.knows(located) and standing:
            self._since_ns = 0
            self.go("", self.goal, located, loaded=self._loaded)
        elif (now_ns - self._since_ns) * 1e-9 > settings.wait_s:
            self._ask(f"place not known: {why}")

    def _rest(self, now_ns: int, *, standing: bool) -> None:
        if not standing:
            self._since_ns = now_ns
        if (now_ns - self._since_ns) * 1e-9 >= self._settings.inversion_s:
            self._since_ns = 0
            self._goes(DRIVING, "rested", gear=self.legs[self.leg].gear)

    def _patience_s(self) -> float:
        """Return how long it stands before it counts as stuck: what has come into the way may leave again."""
        waits = self.sight_m < self._settings.blocked_m and self._tries == 0
        return self._settings.wait_s if waits else self._settings.stuck_s

    def _stuck(self, leg: Leg, left_m: float, located: Located) -> None:
        """Back up and try again, at most so often at one place; then take another way."""
        if self._at_m > self._tried_at_m + _STUCK_RESET_M:
            self._tries = 0
        if self._tries >= self._settings.back_ups:
            self._shut(leg, located)
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

    def _shut(self, leg: Leg, located: Located) -> None:
        """Close the way that the machine is stuck in, and go another one from the point behind it."""
        target = leg.targets[self._target]
        begin_m = leg.targets[self._target - 1].at_m if self._target > 0 else leg.begin_m
        way = f"{target.start}:{target.point}"
        self.close(way)
        self._say("closed", f"tried {self._tries + 1} times", way=way, at_m=self._at_m)
        self._plan([Begin(target.start, max(self._at_m - begin_m, 0.0))], located)

    def _back(self, now_ns: int, motion: Motion, located: Located, standing: bool) -> Directive | None:
        assert self._backing is not None  # noqa: S101  # in this state
        leg, _ = self._backing
        path = moved(leg.path, located.T_odom_map)
        lead = self._leads[leg.gear].state(motion)
        at_m = along_m(path, lead[0], lead[1])
        if not standing or self._since_ns == 0 or not self.may_move:
            self._since_ns = now_ns
        waited = (now_ns - self._since_ns) * 1e-9 > self._settings.stuck_s
        if standing and (abs(leg.stop_m - at_m) < self._settings.arrived_m or waited):
            self._since_ns, self._driven_m, self._begun_m = 0, 0.0, None
            self._goes(DRIVING, "backed up", gear=self.legs[self.leg].gear)
            return None
        return part_of(now_ns, leg.gear, path, min(leg.stop_m, float(path[-1, 5]) - 1.0), at_m)

    def _count(self, motion: Motion) -> None:
        self._speed_mps = motion.speed_mps
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
