"""Drives of known answers: signals, and logs with two scanners in a corridor."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
from lhdmap.evaluation.navigation.signals import SignalCollector, Signals
from lhdmap.logs.writer import LogWriter
from lhdmap.machine import Machine
from lhdmap.messages import Command, Joints, LaserScan, Mount, Tachometer, Text

START_NS = 1_700_000_000_000_000_000
Array = npt.NDArray[np.float64]
Law = Callable[[float], float]
BEAMS, FIRST_RAD, STEP_RAD = 381, -math.radians(95.0), math.radians(0.5)


def ns(time_s: float) -> int:
    """Return a stamp."""
    return START_NS + round(time_s * 1e9)


def nothing(_: float) -> float:
    """Return zero."""
    return 0.0


def messages(
    length_s: float,
    speed: Law = nothing,
    angle: Law = nothing,
    propel: Law = nothing,
    steering: Law = nothing,
    rate_hz: float = 50.0,
) -> list[Tachometer | Joints | Command]:
    """Return tachometer, joints and commands of a drive by laws over time."""
    found: list[Tachometer | Joints | Command] = []
    for time_s in np.arange(round(length_s * rate_hz) + 1) / rate_hz:
        stamp = ns(time_s)
        found.append(Tachometer(stamp, speed(time_s)))
        found.append(Joints(stamp, {"articulation": angle(time_s)}, {}))
        found.append(Command(stamp, propel(time_s), steering(time_s), 0.0, 0.0, False, False))
    return found


def signals(length_s: float, modes: dict[float, str] | None = None, **laws: Law | float) -> Signals:
    """Return the signals of a drive; `modes`: by time of change."""
    collector = SignalCollector()
    for message in messages(length_s, **laws):  # type: ignore[arg-type]
        collector.update(message)
    for time_s, mode in (modes or {}).items():
        collector.update(Text(ns(time_s), mode))
    return collector.signals()


def corridor(left_m: float, right_m: float, y_m: float = 0.0) -> Callable[[Array], Array]:
    """Return ranges to the walls y = left and y = -right from poses (x, y, yaw) of the scanner and beams (N,)."""

    def ranges(pose: Array) -> Array:
        way = pose[2] + FIRST_RAD + STEP_RAD * np.arange(BEAMS)
        with np.errstate(divide="ignore"):
            up = (left_m - (pose[1] + y_m)) / np.sin(way)
            down = (-right_m - (pose[1] + y_m)) / np.sin(way)
        return np.where(up > 0, up, np.where(down > 0, down, np.inf))

    return ranges


def scan(role: str, time_s: float, ranges: Array) -> LaserScan:
    """Return a scan of the front or the rear scanner; a little of it changes, as in any real one."""
    stirred = (ranges + 1e-4 * math.sin(30.0 * time_s)).astype(np.float32)
    return LaserScan(ns(time_s), f"lidar_{role}", FIRST_RAD, STEP_RAD, 0.0, 0.1, 40.0, stirred)


def mounts() -> dict[str, Mount]:
    """Return the mounts of the default machine's scanners, level."""
    found = {}
    for role in ("front", "rear"):
        mount = Machine().mounts[f"lidar_{role}"]
        T = mount.T_parent_sensor.copy()
        yaw = 0.0 if role == "front" else math.pi
        T[:3, :3] = np.diag([math.cos(yaw), math.cos(yaw), 1.0])
        found[role] = Mount(START_NS, mount.parent, f"lidar_{role}", T)
    return found


def _stir(time_s: float) -> float:
    """Return next to nothing, which changes: a sensor that always says the same is taken for a dead one."""
    return 1e-4 * math.sin(20.0 * time_s)


def write_log(path: Path, length_s: float = 12.0, speed_mps: float = 2.0, topics: str = "tjcmfr") -> Path:
    """Write a straight drive through a corridor, 2.0 m to the left and 1.8 m to the right, with the topics of these letters."""
    walls = corridor(2.0, 1.8)
    with LogWriter(path) as writer:
        writer.write("/tf_static", list(mounts().values()), START_NS)
        if "m" in topics:
            writer.write("/operation/mode", Text(START_NS, "manual"))
        for k, message in enumerate(messages(length_s, lambda t: speed_mps + _stir(t), _stir)):
            letter = "tjc"[k % 3]
            if letter in topics:
                writer.write(f"/machine/{('tachometer', 'joints', 'command')[k % 3]}", message)
            time_s = (k // 3) / 50.0
            if k % 6 == 0:
                for role, x_m, yaw in (("front", 0.8, 0.0), ("rear", -6.4, math.pi)):
                    if role[0] in topics:
                        pose = np.array([speed_mps * time_s + x_m, 0.0, yaw])
                        writer.write(f"/lidar/{role}/scan", scan(role, time_s, walls(pose)))
    return path
