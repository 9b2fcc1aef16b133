"""What guidance and navigation make of small worlds, for the probes: drives of a few seconds, trips without sensors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from lhdmap.config import Settings
from lhdmap.driving.lead import lead_of
from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import Directive
from lhdmap.guidance.local_walls import LocalWalls
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.messages import FloatArray
from lhdmap.movement.route import Route, route_json
from lhdmap.movement.routes import RouteOptions, RoutePlanner
from lhdmap.navigation.along import Located
from lhdmap.navigation.control import NavigationControl
from lhdmap.navigation.room import with_room
from lhdmap.topology.model import TopologicalMap

from tests.guidance.planar_drive import Drive, Errors, driving
from tests.guidance.tunnels import BODIES, MODEL, narrow
from tests.movement.mines import fast_ladder

_SECONDS = 7.0


def _told(drive: Iterator[Drive]) -> Iterator[Any]:
    """Yield commands and states each 0.1 s."""
    known = 0
    for out in drive:
        yield out.commands[known:], out.states[-1][:4]
        known = len(out.commands)


def plans(settings: GuidanceSettings) -> Iterator[Any]:
    """Yield what is commanded in a narrow bend, from standstill, with an error in the joint."""
    line, walls = narrow(6.0, 70.0, 0.18, 3)
    errors = Errors(bend_offset_rad=math.radians(0.5), route_m=0.1)
    yield from _told(
        driving(line, walls, settings=settings, seconds=_SECONDS, begin_m=17.0, limit_mps=4.0, errors=errors)
    )


def remembered(settings: GuidanceSettings) -> list[Any]:
    """Return how many hits are kept along a drive."""
    walls, kept = LocalWalls(settings.memory_m), []
    for x in np.arange(0.0, 40.0, 0.5):
        walls.add(np.array([x, 0.0, 0.0]), np.array([[3.0, 1.0], [3.0, -1.0]]))
        kept.append(len(walls.points()))
    return kept


def stops(settings: GuidanceSettings) -> Iterator[Any]:
    """Yield what is commanded on a short straight, fast, to its stop."""
    line, walls = narrow(30.0, 10.0, 1.5, 3)
    fast_mps = MODEL.top_speed_mps
    yield from _told(
        driving(line, walls, settings=settings, seconds=9.0, begin_m=12.0, short_m=24.0, limit_mps=fast_mps)
    )


def barred(settings: GuidanceSettings) -> Iterator[Any]:
    """Yield what is commanded where something stands in the middle of a straight."""
    line, walls = narrow(30.0, 10.0, 1.5, 3)
    middle = line[int(np.hypot(*(line[:, :2] - line[0, :2]).T).searchsorted(24.0)), :2]
    thing = middle + np.array([[x, y] for x in np.arange(-0.2, 0.3, 0.1) for y in np.arange(-0.2, 0.3, 0.1)])
    bars = np.concatenate([walls, thing])
    yield from _told(driving(line, bars, settings=settings, seconds=10.0, begin_m=12.0, limit_mps=2.0))


class Trip:
    """A point of a machine that goes where navigation control says, on a small map, and is kept from it in three ways."""

    def __init__(
        self, settings: Settings, *, loaded: bool, goal: str, held_m: float = math.inf, turned: bool = False
    ) -> None:
        self.said: list[Any] = []
        self._planner = RoutePlanner(_map(), settings.movement)
        self.control = NavigationControl(
            self._planner, MODEL, BODIES, settings.navigation, lambda *what, **values: self.said.append((what, values))
        )
        start = self._planner.topology.points["t1.start"].pose
        self.pose, self.speed, self.gear = np.array([start[0], start[1], start[3] + turned * math.pi]), 0.0, 1
        self.now_ns, self._held_m, self._gone_m = 0, held_m, 0.0
        self.wander_m, self.std_m = 0.0, 0.1
        self._rng = np.random.default_rng(3)
        self.control.go("t1.start", goal, self._located(), loaded=loaded)

    def go(self, seconds: float) -> None:
        """Go on for so long, or until nothing is asked for any more."""
        for _ in range(round(seconds / _STEP_S)):
            if self.control.state in ("arrived", "assistance"):
                return
            self.now_ns += round(_STEP_S * 1e9)
            off = self.wander_m * self._rng.standard_normal(2)
            x, y, heading = (self.pose + np.array([*off, 0.0])).tolist()
            motion = Motion(self.now_ns, x, y, heading, 0.0, 0.0, self.gear * self.speed)
            self._move(self.control.step(self.now_ns, motion, self._located()))

    def _located(self) -> Located:
        covariance = np.diag([self.std_m**2, self.std_m**2, 1e-4])
        return Located(self.now_ns, "tracking", self.pose, self.pose, covariance, 0.0)

    def _move(self, asked: Directive | None) -> None:
        if asked is None:
            self.speed = 0.0
            return
        self.said.append((self.control.state, asked.gear, asked.stop_m, asked.path))
        lead = lead_of(asked.gear, MODEL, BODIES)
        state = lead.state(_standing(self.pose))
        path = asked.path
        near = int(np.hypot(path[:, 0] - state[0], path[:, 1] - state[1]).argmin())
        left = asked.stop_m - float(path[near, 5])
        back = self.control.state == "backing"
        free = math.inf if back else max(self._held_m - self._gone_m, 0.0)
        self.gear, self.speed = asked.gear, min(float(path[near, 3]), 0.5 * max(left, 0.0), free / _STEP_S)
        along = float(path[near, 5]) + self.speed * _STEP_S
        if self.speed * _STEP_S < 0.125:  # between the path's points
            along = max(along, self._along + self.speed * _STEP_S) if self._along - path[near, 5] < 0.25 else along
        self._along = along
        x, y, heading = (float(np.interp(along, path[:, 5], path[:, k])) for k in range(3))
        self._gone_m += (-1.0 if back else 1.0) * self.speed * _STEP_S
        self.pose = np.array(lead.base((x, y, heading, 0.0, 0.0)))

    _along = -math.inf


_STEP_S = 0.1


def _standing(pose: FloatArray) -> Motion:
    x, y, heading = pose.tolist()
    return Motion(0, x, y, heading, 0.0, 0.0, 0.0)


def _map() -> TopologicalMap:
    """The ladder: one tunnel wants to be driven beside its left wall, another ends at a draw point, which is faced."""
    topology = fast_ladder()
    preferring = [
        replace(one, wall_preference="left", half_widths_m=one.half_widths_m + 1.0) if one.id == "t1" else one
        for one in topology.tunnels
    ]
    faced = [replace(one, purpose="draw_point") for one in topology.waypoints]
    return replace(topology, tunnels=tuple(preferring), waypoints=tuple(faced))


def trips(settings: Settings) -> Iterator[Any]:
    """Yield what is said and asked on trips: as planned, loaded, held up, odometer wrong, place less and less known."""
    for loaded, turned, goal in (
        (False, False, "DP1"), (True, False, "DP1"), (False, True, "DP1"), (False, True, "t1.end"),
    ):  # fmt: skip
        trip = Trip(settings, loaded=loaded, goal=goal, turned=turned)
        trip.go(240.0)
        yield trip.said
    held = Trip(settings, loaded=False, goal="DP1", held_m=9.0)
    held.go(120.0)
    yield held.said
    for sight_m in (1.0, 5.0):
        waits = Trip(settings, loaded=False, goal="DP1", held_m=9.0)
        waits.control.allowed.sight_m = sight_m
        waits.go(60.0)
        yield waits.said
    slipping = Trip(settings, loaded=False, goal="DP1")
    slipping.wander_m = 0.4
    slipping.go(120.0)
    yield slipping.said
    unsure = Trip(settings, loaded=False, goal="DP1")
    for _ in range(30):
        unsure.std_m += 0.08
        unsure.go(0.5)
    yield unsure.said
    yield _turned_in_a_stub(settings)


def _turned_in_a_stub(settings: Settings) -> list[Any]:
    """Return the route to a goal that has to be come to the other way round: there is a stub to turn in."""
    topology = _map()
    planner = RoutePlanner(topology, settings.movement)

    def ask(avoid: tuple[str, ...]) -> Route:
        return planner.route("t2.start", "t1.start", RouteOptions("against", "against", avoid=avoid))

    return [route_json(with_room(topology, ask, (), 3.2, 6.5, settings.navigation.room_m))]
