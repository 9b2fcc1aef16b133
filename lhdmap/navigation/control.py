"""Navigation control: drives the legs of a route one after the other, and says what it does and why.

planning -> driving -> resting (a change of gear) -> driving … -> arrived
               | stuck: backing, and another try, at most twice; then the way is closed, and another route is planned
               | place not known: halted, on from there once it is known again
             | the next node may not be entered yet: waiting before it, on once it may
               | no other route, place not known for long, overrun: assistance, until the station says to go on
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import Directive, moved
from lhdmap.messages import FloatArray
from lhdmap.movement.routes import RoutePlanner
from lhdmap.navigation.along import Located, along_m, on_map, part_of
from lhdmap.navigation.begin import Begin, Errand, Reach, begins_at, best_begin, passed_by, route_from
from lhdmap.navigation.goals import Approach, overrun, reached
from lhdmap.navigation.hold import hold_of
from lhdmap.navigation.leg import Leg, legs_of
from lhdmap.navigation.progress import Allowed, BackUps, DrivenBody, LegProgress
from lhdmap.navigation.settings import NavigationSettings

IDLE, DRIVING, RESTING, BACKING, ARRIVED, ASSISTANCE = "idle", "driving", "resting", "backing", "arrived", "assistance"
HALTED, WAITING = "halted", "waiting"
_HELD_M = 1.0  # a machine that stands so near its hold waits for it
_STUCK_RESET_M = 8.0  # so far on from where it was stuck, the tries count anew

Say = Callable[..., None]
"""`say(state, cause, **values)`: told of each change of state (`lhdmap.replay.journal.Scribe.goes`)."""


class NavigationControl:
    """Takes a goal; `step` gives the directive of now, None where the machine is to stand."""

    def __init__(
        self, planner: RoutePlanner, model: DriveModel, bodies: Bodies, settings: NavigationSettings, say: Say
    ) -> None:
        self._planner, self._settings, self._say = planner, settings, say
        self._body = DrivenBody(model, bodies)
        self.state = IDLE
        self.reason = ""
        self.goal, self._loaded = "", False
        self.allowed = Allowed()
        self._way, self._backs = LegProgress(), BackUps()
        self._since_ns = 0

    @property
    def legs(self) -> list[Leg]:
        """The legs of the route."""
        return self._way.legs

    def go(self, start: str, goal: str, located: Located, *, loaded: bool = False) -> None:
        """Plan to a goal from a point of the map, empty: from where the machine is; raises UsageError where a name is wrong."""
        self.goal, self._loaded = goal, loaded
        place = np.append(located.pose_map[:2], located.height_m)
        begins = [Begin(start, 0.0)] if start else begins_at(self._planner.topology, place, goal)
        self._plan(begins, located)

    def wait_for_place(self, now_ns: int, goal: str, located: Located, *, loaded: bool = False) -> None:
        """Take a goal while the place is not known: it is planned once it is, and help is asked for where that takes too long."""
        self.goal, self._loaded, self._since_ns = goal, loaded, now_ns
        self._goes(HALTED, f"place not known: {_how_known(located)}")

    def go_on(self, located: Located, *, reopened: bool = False) -> None:
        """Plan again from where the machine is, after others drove it or helped; `reopened`: what was closed is open again."""
        self.allowed.closed = () if reopened else self.allowed.closed
        if self.state not in (IDLE, ARRIVED) and self.goal:
            self.go("", self.goal, located, loaded=self._loaded)

    def close(self, way: str) -> None:
        """Count a way (a name, or `A:B`) as closed from now on, for routes that are planned then."""
        self.allowed.closed = (*self.allowed.closed, way)

    def _plan(self, begins: list[Begin], located: Located) -> None:
        """Plan to the goal from one of several points; ask for help where nothing leads there."""
        topology, settings, own = self._planner.topology, self._settings, self._body
        if not begins:
            self._ask("no route: there is no point of the map near")
            return
        errand = Errand(
            self.goal,
            float(located.pose_map[2]),
            (*passed_by(topology, self.allowed.avoid, begins, self.goal), *self.allowed.closed),
        )
        body = Reach(own.nose_m, own.tail_m, settings.room_m)
        begin, route = best_begin(begins, lambda point: route_from(self._planner, point, errand, body))
        if not route.feasible:
            self._ask(f"no route: {route.reason}")
            return
        legs = legs_of(topology, route, own.wheelbase_m, own.nose_m, settings, loaded=self._loaded, away_m=begin.away_m)
        self._way.begin(legs)
        self._backs.begin()
        self._since_ns = 0
        if not legs:
            self._goes(ARRIVED, "already there")
            return
        if legs[0].gear * self._way.speed_mps < -self._settings.standing_mps:
            self._goes(RESTING, "the other gear", gear=legs[0].gear)
            return
        told = {"legs": len(legs), "distance_m": route.distance_m, "gear": legs[0].gear, "begin": begin.point}
        self._goes(DRIVING, "route", goal=self.goal, **told)

    def step(self, now_ns: int, motion: Motion, located: Located) -> Directive | None:
        """Return the directive of now."""
        if self._way.paused(now_ns):  # somebody else had the machine: that it stood is no sign of being stuck
            self._since_ns = now_ns
        self._way.count(motion, backs=self.state == BACKING)
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
    def on_last_leg(self) -> bool:
        """Whether the leg to the goal is driven."""
        return self._way.leg == len(self.legs) - 1

    @property
    def left_m(self) -> float:
        """Way to the end of the last leg; infinite where there is none."""
        if self.state not in (DRIVING, WAITING, RESTING, BACKING, HALTED) or not self.legs:
            return math.inf
        return self._way.left_m

    def knows(self, located: Located) -> bool:
        """Return whether a place is good enough to drive by."""
        return located.status == "tracking" and located.deviation_m <= self._settings.believe_m

    def _drive(self, now_ns: int, motion: Motion, located: Located, standing: bool) -> Directive | None:
        way = self._way
        leg = way.now
        path = moved(leg.path, located.pose_odom_map)
        lead = self._body.leads[leg.gear].state(motion)
        way.place(path, lead[0], lead[1])
        left_m = leg.stop_m - way.at_m
        self._pass_targets(leg, motion, located)
        if overrun(way.driven_m, way.length_m, self._settings):  # much farther than the node of the target is long
            self._ask("overrun: the tunnel's end was missed")
            return None
        if standing and abs(left_m) < self._settings.arrived_m:
            self._stopped(now_ns, leg)
            return None
        hold = hold_of(self._planner.topology, leg, way.at_m, self.allowed.free, self._body.reach_m(leg.gear))
        if hold.stop_m < leg.stop_m and standing and way.at_m > hold.stop_m - _HELD_M:
            self._since_ns = now_ns
            self._goes(WAITING, "the next node is not free", node=hold.node)
            return None
        if self.state == WAITING:
            self._goes(DRIVING, "the next node is free")
        if not standing or self._since_ns == 0 or not self.allowed.may_move:
            self._since_ns = now_ns
        if (now_ns - self._since_ns) * 1e-9 > self._patience_s():
            self._stuck(leg, left_m, located)
            return None
        return part_of(now_ns, leg.gear, path, min(leg.stop_m, hold.stop_m), way.at_m)

    def _pass_targets(self, leg: Leg, motion: Motion, located: Located) -> None:
        """Say which targets are reached, one after the other, before the machine is there."""
        while self._way.target < len(leg.targets) - 1:
            target = leg.targets[self._way.target]
            approach = self._approach(leg, target.pose, motion, located)
            if not reached(approach, self._settings, crossing=target.crossing) and self._way.at_m < target.at_m + 3.0:
                return
            self._way.target += 1
            self._way.driven_m = 0.0
            self._say(DRIVING, "target", point=target.point, node=leg.targets[self._way.target].node)

    def _approach(self, leg: Leg, pose: FloatArray, motion: Motion, located: Located) -> Approach:
        lead = self._body.leads[leg.gear]
        x, y, heading, _, _ = lead.state(on_map(motion, located))
        offset = pose[:2] - np.array([x, y])
        far = max(float(np.linalg.norm(offset)), 1e-6)
        speed = lead.speed_mps(motion)
        closing = speed * float(offset @ np.array([math.cos(heading), math.sin(heading)])) / far
        course = pose[3] if math.cos(pose[3] - heading) > 0.0 else pose[3] + math.pi
        return Approach(offset, located.covariance[:2, :2], closing, heading - course)

    def _stopped(self, now_ns: int, leg: Leg) -> None:
        self._backs.tries = 0
        self._since_ns = now_ns
        if self._way.stopped():
            self._goes(ARRIVED, "stop", goal=self.goal)
        else:
            self._goes(RESTING, "inversion" if leg.inversion else "stop", gear=self._way.now.gear)

    def _halt(self, now_ns: int, located: Located, *, standing: bool) -> None:
        """Stand where the place is not known; go on from there once it is, or ask after some time."""
        settings, why = self._settings, _how_known(located)
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
            self._goes(DRIVING, "rested", gear=self._way.now.gear)

    def _patience_s(self) -> float:
        """Return how long it stands before it counts as stuck: what has come into the way may leave again."""
        waits = self.allowed.sight_m < self._settings.blocked_m and self._backs.tries == 0
        return self._settings.wait_s if waits else self._settings.stuck_s

    def _stuck(self, leg: Leg, left_m: float, located: Located) -> None:
        """Back up and try again, at most so often at one place; then take another way."""
        backs, at_m = self._backs, self._way.at_m
        if at_m > backs.at_m + _STUCK_RESET_M:
            backs.tries = 0
        if backs.tries >= self._settings.back_ups:
            self._shut(leg, located)
            return
        backs.back(leg, at_m, self._body.wheelbase_m, self._settings.back_up_m)
        self._since_ns = 0
        self._goes(BACKING, "stuck", at_m=at_m, left_m=left_m, tries=backs.tries)

    def _shut(self, leg: Leg, located: Located) -> None:
        """Close the way that the machine is stuck in, and go another one from the point behind it."""
        target = leg.targets[self._way.target]
        begin_m = leg.targets[self._way.target - 1].at_m if self._way.target > 0 else leg.begin_m
        way = f"{target.start}:{target.point}"
        self.close(way)
        self._say("closed", f"tried {self._backs.tries + 1} times", way=way, at_m=self._way.at_m)
        self._plan([Begin(target.start, max(self._way.at_m - begin_m, 0.0))], located)

    def _back(self, now_ns: int, motion: Motion, located: Located, standing: bool) -> Directive | None:
        leg = self._backs.leg
        assert leg is not None  # noqa: S101  # in this state
        path = moved(leg.path, located.pose_odom_map)
        lead = self._body.leads[leg.gear].state(motion)
        at_m = along_m(path, lead[0], lead[1])
        if not standing or self._since_ns == 0 or not self.allowed.may_move:
            self._since_ns = now_ns
        waited = (now_ns - self._since_ns) * 1e-9 > self._settings.stuck_s
        if standing and (abs(leg.stop_m - at_m) < self._settings.arrived_m or waited):
            self._since_ns, self._way.driven_m, self._way.begun_m = 0, 0.0, None
            self._goes(DRIVING, "backed up", gear=self._way.now.gear)
            return None
        return part_of(now_ns, leg.gear, path, min(leg.stop_m, float(path[-1, 5]) - 1.0), at_m)

    def _ask(self, why: str) -> None:
        self.reason = why
        self._goes(ASSISTANCE, why)

    def _goes(self, state: str, cause: str, **values: Any) -> None:
        self.state = state
        self._say(state, cause, **values)


def _how_known(located: Located) -> str:
    return f"{located.status}, deviation {located.deviation_m:.2f} m"
