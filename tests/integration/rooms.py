"""Known geometry for the tests: rooms and tubes whose ranges are exact, and machines that move through them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from lhdmap.integration.project import SweepPoses
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, Mount

BEAMS = 381
ANGLE_MIN_RAD = math.radians(-95.0)
INCREMENT_RAD = math.radians(0.5)
Pose = Callable[[float], FloatArray]
Surface = Callable[[FloatArray, FloatArray], float]
Distance = Callable[[FloatArray], FloatArray]

ROOM = ((-6.0, 9.0), (-3.0, 4.0), (-0.5, 3.5))
TUBE_RADIUS_M = 2.5


def room_range(origin: FloatArray, direction: FloatArray) -> float:
    """Range from inside the room to its six walls."""
    hits = [
        (wall - origin[axis]) / direction[axis]
        for axis, walls in enumerate(ROOM)
        for wall in walls
        if abs(direction[axis]) > 1e-12
    ]
    return min(hit for hit in hits if hit > 0.0)


def room_distance(points: FloatArray) -> FloatArray:
    """Distance of points, shape (N, 3), from the nearest wall of the room."""
    return np.min([np.abs(points[:, axis] - wall) for axis, walls in enumerate(ROOM) for wall in walls], axis=0)


def tube_range(origin: FloatArray, direction: FloatArray) -> float:
    """Range from inside a tube around the x axis to its wall."""
    a = direction[1] ** 2 + direction[2] ** 2
    b = origin[1] * direction[1] + origin[2] * direction[2]
    c = origin[1] ** 2 + origin[2] ** 2 - TUBE_RADIUS_M**2
    return float((-b + math.sqrt(b * b - a * c)) / a) if a > 1e-9 else math.inf


def tube_distance(points: FloatArray) -> FloatArray:
    """Distance of points, shape (N, 3), from the wall of the tube."""
    return np.abs(np.hypot(points[:, 1], points[:, 2]) - TUBE_RADIUS_M)


def mount_of(machine: Machine, name: str) -> Mount:
    """The mount of a machine file's sensor as the log would give it."""
    mount = machine.mounts[name]
    return Mount(0, mount.parent, name, mount.T_parent_sensor)


def sensor_at(mount: Mount, machine: Machine, pose: Pose, angle: Callable[[float], float], t: float) -> FloatArray:
    """T_map_sensor at a time, by the kinematics of the machine."""
    T = pose(t)
    if mount.parent_frame == "rear_link":
        T = T @ T_base_rear(angle(t), machine)
    return T @ mount.T_parent_child


def sweep(
    surface: Surface,
    T_map_sensor: Pose,
    start_s: float,
    duration_s: float,
    frame_id: str,
    step_rad: float = INCREMENT_RAD,
) -> LaserScan:
    """A scan of a surface, each beam measured at its own time from its own pose."""
    first = ANGLE_MIN_RAD if step_rad > 0.0 else -ANGLE_MIN_RAD
    ranges = np.empty(BEAMS)
    for i in range(BEAMS):
        T = T_map_sensor(start_s + duration_s * i / (BEAMS - 1))
        angle = first + i * step_rad
        ranges[i] = surface(T[:3, 3], T[:3, :3] @ np.array([math.cos(angle), math.sin(angle), 0.0]))
    time_step_s = duration_s / (BEAMS - 1)
    return LaserScan(
        round(start_s * 1e9), frame_id, first, step_rad, time_step_s, 0.05, 80.0, ranges.astype(np.float32)
    )


def ends(pose: Pose, angle: Callable[[float], float], start_s: float, duration_s: float) -> SweepPoses:
    """The machine at both ends of a sweep."""
    return SweepPoses(pose(start_s), pose(start_s + duration_s), angle(start_s), angle(start_s + duration_s))
