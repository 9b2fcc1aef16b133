"""A machine that follows directives exactly, straight as a rod: navigation control without guidance and without sensors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.driving.motion import Motion
from lhdmap.geometry import se2
from lhdmap.guidance.directive import Directive
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.movement.routes import RoutePlanner
from lhdmap.navigation.along import Located
from lhdmap.navigation.control import ARRIVED, ASSISTANCE, NavigationControl
from lhdmap.navigation.settings import NavigationSettings
from lhdmap.topology.model import TopologicalMap

STEP_S = 0.1
ODOM_IN_MAP = np.array([3.0, -2.0, 0.4])
MODEL = drive_model(Machine(), 0.0)


@dataclass
class Rod:
    """Where the machine is in `map`; `stops(x, y)` tells where it cannot go on in its gear."""

    pose: FloatArray
    topology: TopologicalMap
    settings: NavigationSettings = field(default_factory=NavigationSettings)
    stops: Callable[[FloatArray], bool] = lambda _: False
    status: str = "tracking"
    speed_mps: float = 0.0
    now_ns: int = 0
    said: list[tuple[str, str, dict[str, Any]]] = field(default_factory=list)
    places: list[tuple[int, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.control = NavigationControl(
            RoutePlanner(self.topology),
            MODEL,
            bodies_of(Machine()),
            self.settings,
            lambda state, cause, **values: self.said.append((state, cause, values)),
        )

    @property
    def states(self) -> list[str]:
        """The states that were said, in order."""
        return [one[0] for one in self.said]

    def located(self) -> Located:
        """Return the place as localization would tell it."""
        in_odom = se2.compose(se2.inverse(ODOM_IN_MAP), self.pose)
        return Located(self.now_ns, self.status, self.pose.copy(), in_odom, np.eye(3) * 1e-4, 0.0)

    def motion(self) -> Motion:
        """Return how it moves, in `odom`."""
        x, y, heading = self.located().pose_odom.tolist()
        return Motion(self.now_ns, x, y, heading, 0.0, 0.0, self.speed_mps)

    def go(self, goal: str, start: str = "") -> None:
        """Give it a goal."""
        self.control.go(start, goal, self.located())

    def step(self) -> Directive | None:
        """Ask for a directive and follow it for a moment."""
        directive = self.control.step(self.now_ns, self.motion(), self.located())
        self._follow(directive)
        self.now_ns += round(STEP_S * 1e9)
        return directive

    def run(self, for_s: float = 400.0, until: str = "") -> str:
        """Go on until it has arrived, asks for help, or is in a state; return its state."""
        for _ in range(round(for_s / STEP_S)):
            self.step()
            if self.control.state in (ARRIVED, ASSISTANCE, until):
                break
        return self.control.state

    def _follow(self, directive: Directive | None) -> None:
        self.speed_mps = 0.0
        if directive is None:
            return
        path, gear = directive.path, directive.gear
        pose_map_odom = self.located()
        lead = se2.compose(pose_map_odom.pose_odom, np.array([-MODEL.wheelbase_m if gear < 0 else 0.0, 0.0, 0.0]))
        near = int(np.hypot(path[:, 0] - lead[0], path[:, 1] - lead[1]).argmin())
        at = path[near, 5] + float((lead[:2] - path[near, :2]) @ [math.cos(path[near, 2]), math.sin(path[near, 2])])
        wanted = min(at + min(path[near, 3], 2.0) * STEP_S, directive.stop_m)
        x, y, heading = (float(np.interp(wanted, path[:, 5], path[:, k])) for k in (0, 1, 2))
        if gear < 0:
            x, y, heading = (
                x - MODEL.wheelbase_m * math.cos(heading), y - MODEL.wheelbase_m * math.sin(heading), heading + math.pi,
            )  # fmt: skip
        there = se2.compose(ODOM_IN_MAP, np.array([x, y, heading]))
        if self.stops(there) and wanted - at > 1e-6:
            return
        self.speed_mps = gear * (wanted - at) / STEP_S
        self.pose = there
        self.places.append((gear, float(there[0]), float(there[1])))
