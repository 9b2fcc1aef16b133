"""Drives over a site from point to point: which edges, which waypoints, which dock; the tracker does the rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.docking.planner import plan_dock
from lhdmap.docking.room import Room, room_of
from lhdmap.docking.run import LegRun
from lhdmap.docking.settings import DockingSettings
from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoint
from lhdmap.errors import InputError
from lhdmap.haulage.layout import GOALS, Layout
from lhdmap.haulage.ways import apron_of, pose_at_end, way_of
from lhdmap.messages import FloatArray
from lhdmap.replay.site_sight import SiteSight
from lhdmap.tracking.kernel import State, front_axle
from lhdmap.tracking.tracker import Step, Tracker

APRON_M = 12.0
"""Around all ways in an area there is so much ground."""
IDLE, DRIVING, HALTED, ARRIVED, MISSED, ASSISTANCE = "idle", "driving", "halted", "arrived", "missed", "assistance"
_DOCK_M, _DOCK_RAD = 0.3, math.radians(3.0)


class SiteGround(NamedTuple):
    """What is known of site and machine."""

    layout: Layout
    bodies: Bodies
    models: tuple[DriveModel, DriveModel]
    docking: DockingSettings

    def room(self, area: str, margin_m: float) -> Room:
        """Return the room on the apron of an area."""
        return room_of(apron_of(self.layout, area, APRON_M), self.models[0], self.bodies, margin_m)


class SiteDrive:
    """One drive after the other; `at` is the point where it stands, or stood last, `edges` and `docks` what it is on."""

    def __init__(self, ground: SiteGround, tracker: Tracker, at: str) -> None:
        self._ground, self._tracker = ground, tracker
        self.at, self.goal, self.state, self.reason = at, "", IDLE, ""
        self.edges: tuple[int, ...] = ()
        self.docks = False
        self._dock, self._at_backup = -1, False
        self._legs: LegRun | None = None

    def begin(self, goal: str, *, loaded: bool) -> None:
        """Begin a drive to a point."""
        self._tracker.model = self._ground.models[loaded]
        again = self.state == ASSISTANCE and goal == self.goal
        self.goal, self.state, self.reason = goal, DRIVING, ""
        if again and self.edges:
            self._again()
            return
        self._legs, self.docks = None, False
        layout = self._ground.layout
        back = next((k for k in layout.entering[self.at] if layout.edges[k].start == goal), None)
        try:
            if goal == self.at:
                self.state = ARRIVED
            elif back is not None and layout.point[goal].purpose == "queue":  # a dock was missed: it is tried again
                to_queue = layout.entering[goal][0]
                self._lay(to_queue, pose_at_end(layout, to_queue), gear=1)
            else:
                self._follow(layout.route(self.at, goal))
        except InputError as error:
            self.state, self.reason = ASSISTANCE, str(error)

    def _again(self) -> None:
        """Go on with the drive after help: with its dock where it had come to it, else along the edges that it was on."""
        try:
            if self._dock >= 0 and self._at_backup:
                self._lay(self._dock, pose_at_end(self._ground.layout, self._dock), gear=-1)
            else:
                self._legs = None
                way = way_of(self._ground.layout, self.edges)
                self._tracker.follow(way.points_m, way.speeds_mps)
        except InputError as error:
            self.state, self.reason = ASSISTANCE, str(error)

    def step(self, now_ns: int, motion: Motion, sent: Sequence[Setpoint]) -> Step:
        """Return what to do now."""
        step = (self._legs or self._tracker).step(now_ns, motion, sent)
        if self.state == HALTED and step.state != "stopped":
            self.state, self.reason = DRIVING, ""
        if self.state != DRIVING:
            return step
        if step.state == "stopped":
            late = now_ns - motion.stamp_ns > self._tracker.settings.age_s * 1e9
            self.state, self.reason = HALTED if late else ASSISTANCE, step.reason
        elif step.state == "arrived":
            self._arrived()
        return step

    def blocked(self, sight: SiteSight) -> bool:
        """Return whether something that is seen stands in the way of what is driven."""
        leg, state = self._tracker.leg, self._tracker.filter
        if self.state != DRIVING or leg is None:
            return False
        return sight.blocked(leg.curve, state.state[:3], state.front_mps, self._tracker.model)

    def errors_of(self, edge: int) -> tuple[float, float]:
        """Return how far (m, rad) the machine, as it believes, stands from the end of an edge."""
        x, y, heading = front_axle(self._state(), self._tracker.filter.lengths)
        pose = pose_at_end(self._ground.layout, edge)
        return math.hypot(x - pose[0], y - pose[1]), abs(math.remainder(heading - pose[2], 2.0 * math.pi))

    def _state(self) -> State:
        x, y, heading, bend, rate = self._tracker.filter.state[:5].tolist()
        return x, y, heading, bend, rate

    def _follow(self, edges: list[int] | None) -> None:
        if not edges:
            raise InputError(f"no way leads from {self.at} to {self.goal}")
        way = way_of(self._ground.layout, edges)
        self._tracker.follow(way.points_m, way.speeds_mps)
        self.edges, self._dock, self._at_backup = tuple(edges), way.dock, False

    def _arrived(self) -> None:
        """Go on with the dock at the end of a way, or say how the drive ended."""
        layout = self._ground.layout
        if self._dock >= 0 and not self.docks:  # the way up to the backup point
            self._at_backup = True
            try:
                self._lay(self._dock, pose_at_end(layout, self._dock), gear=-1)
            except InputError as error:
                self.state, self.reason = ASSISTANCE, str(error)
            return
        last = self._dock if self._dock >= 0 else self.edges[-1]
        off_m, off_rad = self.errors_of(last)
        docked = layout.point[self.goal].purpose not in GOALS or (off_m <= _DOCK_M and off_rad <= _DOCK_RAD)
        self.at, self._dock = self.goal, -1
        self.state = ARRIVED if docked else MISSED
        self.reason = "" if docked else f"{off_m:.2f} m, {math.degrees(off_rad):.1f} deg off"

    def _lay(self, edge: int, pose: FloatArray, gear: int) -> None:
        """Plan a way to a pose on the apron of an edge's area, from where the machine stands, and begin it."""
        ground, state = self._ground, self._state()
        x, y, heading = front_axle(state, self._tracker.filter.lengths)
        room = ground.room(ground.layout.edges[edge].area, ground.docking.margin_m)
        plan = plan_dock(np.array([x, y, heading, state[3]]), pose, room, self._tracker.model, ground.docking, gear)
        if plan.reason:
            raise InputError(plan.reason)
        self._legs, self.docks, self.edges = LegRun(self._tracker, plan.legs, ground.docking.speed_mps), True, (edge,)
