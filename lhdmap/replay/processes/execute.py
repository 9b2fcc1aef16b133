"""Command executor, watchdog and guard as a process: the last one before the machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.executor.control import Control
from lhdmap.executor.limits import pull_mps2
from lhdmap.executor.notes import Stop
from lhdmap.executor.watchdog import GUIDANCE, LINK, MOTION, OPERATOR, SCAN_FRONT, SCAN_REAR
from lhdmap.guidance.planner import Plan
from lhdmap.integration.beams import scan_points
from lhdmap.kinematics import T_base_rear
from lhdmap.localization.floor import NO_FLOOR, over_floor
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    DIRECTIVE,
    MACHINE_SAYS,
    MILLISECOND_NS,
    ORDERS,
    PEDALS,
    PLAN,
    POSE,
    SEEN,
    STATION_SAYS,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.feed import MOTION_TOPICS, MotionFeed
from lhdmap.replay.processes.told import Asked, Digs, Health, Idle, ModeNow, Orders, Seen, Word
from lhdmap.roles import ROLES

EXECUTOR = "executor"
PERIODS_S = {MOTION: 0.02, SCAN_FRONT: 0.04, SCAN_REAR: 0.04, "pose": 0.2, GUIDANCE: 0.05, OPERATOR: 0.1, LINK: 0.1}
"""Inputs of the watchdog and their periods; the pose of a scan is later than the scan: it waits for the inclinometer's filter."""
_FRONT, _REAR = ROLES["front"].topic, ROLES["rear"].topic
_COMMAND = ROLES["command"].topic
_TELLS_NS = 200 * MILLISECOND_NS
_GUARD_RANGE_M = 20.0
_FLOOR_M = 0.3  # hits lower over the floor are its own, and no obstacle


class _Guidance:
    """What guidance and navigation last wanted: a stop, help (empty: none), a gear."""

    def __init__(self) -> None:
        self.wanted = Stop.GO
        self.asks, self.gear = "", 1


class _Ground:
    """What is known of it: the pull of the grade, how the machine leans on it (3, 3), the floor about (K, 3) as the map has it."""

    def __init__(self) -> None:
        self.pull_mps2 = 0.0
        self.R_level_base: FloatArray = np.eye(3)
        self.floor_m: FloatArray = NO_FLOOR

    def take(self, T_odom_base: FloatArray) -> None:
        """Take a pose (4, 4)."""
        R, yaw = T_odom_base[:3, :3], math.atan2(T_odom_base[1, 0], T_odom_base[0, 0])
        c, s = math.cos(yaw), math.sin(yaw)
        self.pull_mps2 = pull_mps2(T_odom_base)
        self.R_level_base = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ R


class Execute(Process):
    """A command each 20 ms. `models`: of the empty and the loaded machine, where a mission says which it is."""

    name, period_ns, priority = EXECUTOR, 20 * MILLISECOND_NS, 40
    reads = (*MOTION_TOPICS, _FRONT, _REAR, SEEN, PLAN, PEDALS, DIRECTIVE, STATION_SAYS, ORDERS)

    def __init__(
        self,
        control: Control,
        machine: Machine,
        mode: ModeNow,
        scribe: Scribe,
        *,
        models: tuple[DriveModel, DriveModel] | None = None,
    ) -> None:
        self._models, self._loaded = models, False
        self.control, self._machine, self._mode, self._scribe = control, machine, mode, scribe
        self._feed = MotionFeed()
        self._guidance = _Guidance()
        self._told_ns = 0
        self._ground = _Ground()
        self._takes: dict[str, Callable[[Any, int], None]] = {
            _FRONT: lambda scan, now_ns: self._scan(scan, now_ns, front=True),
            _REAR: lambda scan, now_ns: self._scan(scan, now_ns, front=False),
            PLAN: self._plan,
            SEEN: self._compare,
            PEDALS: self._dig,
            DIRECTIVE: self._ask,
            STATION_SAYS: self._obey,
            ORDERS: self._carry,
        }

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; give the command of now."""
        for received in inbox:
            self._take(received, now_ns)
        follows = self.control.modes.mode.source == "guidance" and not self.control.digs(now_ns)
        wanted = self._guidance.wanted if follows else Stop.GO
        command = self.control.step(now_ns, self._feed.motion, wanted, "navigation", self._ground.pull_mps2)
        for who, note in self.control.take_notes():
            self._scribe.event(
                f"{who}: {note.event}", note.cause, before=note.before, after=note.after, **dict(note.values)
            )
        self._scribe.goes(self.control.executor.state, self.control.modes.name)
        self._mode.text = self.control.modes.name
        yield Outgoing(_COMMAND, command)
        if now_ns - self._told_ns >= _TELLS_NS:
            self._told_ns = now_ns
            yield Outgoing(MACHINE_SAYS, self._health(now_ns))

    def _take(self, received: Received, now_ns: int) -> None:
        take = self._takes.get(received.topic)
        if take is not None:
            take(received.message, now_ns)
            return
        self._feed.take(received)
        if self._feed.heard_ns is not None:
            self.control.watchdog.saw(MOTION, self._feed.heard_ns, now_ns)
        if received.topic == POSE:
            self._ground.take(received.message.T_odom_base)

    def _plan(self, plan: Plan | Idle, now_ns: int) -> None:
        self.control.watchdog.saw(GUIDANCE, plan.stamp_ns, now_ns)
        if not isinstance(plan, Idle):
            self._guidance.gear = plan.gear
            self.control.plan("guidance", plan.setpoints, plan.stamp_ns, now_ns)

    def _dig(self, digs: Digs, now_ns: int) -> None:
        self.control.touches(digs.touched_m)
        self.control.dig(digs.pedals, now_ns)

    def _carry(self, orders: Orders, now_ns: int) -> None:
        if self._models is not None and orders.loaded != self._loaded:
            self._loaded = orders.loaded
            self.control.loaded(self._models[self._loaded])

    def _compare(self, seen: Seen, now_ns: int) -> None:
        """Tell the watchdog by how much pose and scan disagree; wheels that dig slip, and say nothing of the scan."""
        self._ground.floor_m = seen.floor_m
        lost = math.isinf(seen.apart_m)
        apart = (seen.apart_m, seen.apart_rad) if lost or not self.control.digs(now_ns) else (0.0, 0.0)
        self.control.watchdog.disagreement(seen.stamp_ns, now_ns, *apart)

    def _ask(self, asked: Asked, now_ns: int) -> None:
        self._guidance.wanted = Stop.SERVICE if asked.directive is None else Stop.GO
        self.control.touches(asked.touched_m)
        self._guidance.asks = asked.cause if asked.cause.startswith("assistance") else ""

    def _scan(self, scan: LaserScan, now_ns: int, *, front: bool) -> None:
        points, _ = scan_points(scan)
        content = hash(scan.ranges_m.tobytes())
        name = SCAN_FRONT if front else SCAN_REAR
        if len(points) == 0 or not self.control.watchdog.saw(name, scan.stamp_ns, now_ns, content=content):
            return
        motion = self._feed.motion
        if motion is not None:
            self.control.points(name, self._in_base(points, motion, front=front), motion)

    def _in_base(self, points: FloatArray, motion: Motion, *, front: bool) -> FloatArray:
        """Return points (M, 2) of a scanner in `base_link`, as its mount on the file has it."""
        mount = self._machine.mounts["lidar_front" if front else "lidar_rear"]
        T = mount.T_parent_sensor
        if mount.parent == "rear_link":
            T = T_base_rear(motion.articulation_rad, self._machine) @ T
        placed = points @ T[:3, :3].T + T[:3, 3]
        near = placed[(np.hypot(placed[:, 0], placed[:, 1]) < _GUARD_RANGE_M) & (placed[:, 2] > _FLOOR_M)]
        pose = np.array([motion.x_m, motion.y_m, motion.heading_rad])
        kept: FloatArray = near[
            over_floor(near @ self._ground.R_level_base.T, pose, self._ground.floor_m, _FLOOR_M), :2
        ]
        return kept

    def _obey(self, word: Word, now_ns: int) -> None:
        control = self.control
        control.watchdog.saw(LINK, word.stamp_ns, now_ns)
        control.watchdog.saw(OPERATOR, word.stamp_ns, now_ns)
        if word.emergency:
            control.emergency(word.emergency)
        if word.stop:
            control.watchdog.trip((word.stop,))
        if word.release:
            control.release("station")
        if word.rearm:
            control.rearm(now_ns, word.mode)
        if word.mode:
            control.mode(word.mode, now_ns, "station")
        if word.speed_mps is not None:
            control.operate(word.speed_mps, word.steering_rate_rps, word.stamp_ns, now_ns)

    def _health(self, now_ns: int) -> Health:
        control = self.control
        watchdog = control.watchdog
        standing, causes = control.executor.standing, watchdog.causes
        return Health(
            now_ns, watchdog.armed, control.modes.name, standing, causes, self._guidance.asks, self._guidance.gear
        )
