"""Connections: ways that the machine can drive between two points of a node, and whether it can drive them at all.

Through an intersection a way is a biarc from one access point to the other, in a tunnel the centre line between two points. Its
least radius is compared with the machine's; then both bodies are driven along it, the joint as the front axle's path demands
(Eq. (1)), once in each direction: that is forward from either end, and in reverse from the other. Where a body meets a wall the
connection is not feasible.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from lhdmap.kinematics import articulation_along_path
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.biarc import biarc
from lhdmap.topology.arcs import resampled
from lhdmap.topology.graph import Graph
from lhdmap.topology.model import Connection, Kind

_STEP_M = 0.25
_SMOOTH_STEPS = 8.0  # 2 m of a centre line: what roughness leaves of curvature
_OUTLINE_M = 0.4
_TOUCH_M = 0.0
_RADIUS_SHARE = 0.98


class Walls:
    """How far from the walls a point of a sheet is."""

    def __init__(self, graph: Graph) -> None:
        self._sheet = graph.sheet
        free = graph.room.free.astype(np.uint8)
        cell_m = graph.sheet.cell_m
        inside = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * cell_m
        outside = cv2.distanceTransform(1 - free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * cell_m
        self._distance_m = (
            inside - outside
        )  # beams end half a cell before the wall: no correction for the cell's own half

    def clearance_m(self, points_m: FloatArray) -> float:
        """Return the least distance of points (N, 2) from a wall, negative within it."""
        cells = self._sheet.at(points_m)
        inside = ((cells >= 0) & (cells < self._distance_m.shape)).all(axis=1)
        if not inside.all():
            return -math.inf
        return float(self._distance_m[cells[:, 0], cells[:, 1]].min())


class Drivable(NamedTuple):
    """What of a machine decides whether a way can be driven: outlines (N, 2) of both bodies, lengths, radius, width."""

    front_m: FloatArray
    rear_m: FloatArray
    joint_to_front_m: float
    joint_to_rear_m: float
    least_radius_m: float
    width_m: float


def drivable(machine: Machine) -> Drivable:
    """Return the outlines and the tightest radius of `base_link` of a machine."""
    size = machine.dimensions
    angle = math.radians(size.max_articulation_deg)
    front, rear = size.joint_to_front_axle_m, size.joint_to_rear_axle_m
    least = (front * math.cos(angle) + rear) / math.sin(angle)  # of the front axle: κ (L_f cos γ + L_r) = sin γ
    return Drivable(_outline(machine, "base_link"), _outline(machine, "rear_link"), front, rear, least, size.width_m)


def machine_of_width(width_m: float) -> Machine:
    """Return the default machine, made smaller or larger as a whole: what is known of a robot that nobody described."""
    machine = Machine()
    scale = width_m / machine.dimensions.width_m
    if abs(scale - 1.0) < 1e-6:
        return machine
    size = machine.dimensions
    dimensions = replace(
        size,
        joint_to_front_axle_m=scale * size.joint_to_front_axle_m,
        joint_to_rear_axle_m=scale * size.joint_to_rear_axle_m,
        width_m=width_m,
    )
    bodies = {
        name: replace(box, min_m=_scaled(box.min_m, scale), max_m=_scaled(box.max_m, scale))
        for name, box in machine.bodies.items()
    }
    return replace(machine, dimensions=dimensions, bodies=bodies)


def _scaled(corner_m: tuple[float, float, float], scale: float) -> tuple[float, float, float]:
    x, y, z = corner_m
    return scale * x, scale * y, scale * z


def way_between(start: FloatArray, end: FloatArray) -> FloatArray | None:
    """Return the way (N, 3) from a pose (4,) to another, None where only loops lead there."""
    try:
        line = biarc(start, end)
    except ValueError:
        return None
    s = np.append(np.arange(0.0, line.length_m, _STEP_M), line.length_m)
    points: FloatArray = line.at(s)[:, :3]
    return points


def connection(
    names: tuple[str, str, Kind],
    way_m: FloatArray | None,
    chord_m: FloatArray,
    walls: Walls | None,
    machine: Drivable,
    speed_kmh: float,
) -> Connection:
    """Return the connection of two points along a way (N, 3), or the reason why none can be driven.

    `chord_m` (2, 3): what is drawn where there is no way; `walls`: None where the way leaves its sheet, its room is the tunnel's.
    """
    if way_m is None:
        chord = float(np.linalg.norm(np.diff(chord_m, axis=0)))
        return Connection(*names, chord_m, chord, 0.0, 0.0, speed_kmh, False, False, "no way without a loop")
    line = resampled(way_m, _STEP_M)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    curvature = _curvature(line)
    radius = 1.0 / float(np.abs(curvature).max()) if np.abs(curvature).max() > 1e-4 else math.inf
    clearance = math.inf if walls is None else min(_swept(line, walls, machine), _swept(line[::-1], walls, machine))
    reason = ""
    if radius < _RADIUS_SHARE * machine.least_radius_m:
        reason = f"radius {radius:.1f} m, the machine needs {machine.least_radius_m:.1f} m"
    elif clearance < _TOUCH_M:
        reason = f"a body would touch the wall ({clearance:.2f} m)"
    shown = resampled(way_m, 1.0)
    return Connection(*names, shown, length, radius, clearance, speed_kmh, not reason, False, reason)


def _curvature(line: FloatArray) -> FloatArray:
    """Return the curvature (N,) of a line of even steps, 1/m."""
    way = np.diff(line[:, :2], axis=0)
    heading = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    if len(heading) < 3:
        return np.zeros(len(line))
    step = max(float(np.linalg.norm(way, axis=1).mean()), 1e-6)
    curvature = gaussian_filter1d(np.gradient(heading, step), _SMOOTH_STEPS, mode="nearest")
    return np.append(curvature, curvature[-1])


def _swept(line: FloatArray, walls: Walls, machine: Drivable) -> float:
    """Return the least clearance of both bodies when the front axle follows a line forwards."""
    curvature = _curvature(line)
    limit = 0.999 / machine.least_radius_m
    step = float(np.linalg.norm(line[1, :2] - line[0, :2]))
    joint = articulation_along_path(
        np.clip(curvature, -limit, limit), step, machine.joint_to_front_m, machine.joint_to_rear_m
    )
    way = np.gradient(line[:, :2], axis=0)
    heading = gaussian_filter1d(np.unwrap(np.arctan2(way[:, 1], way[:, 0])), 2.0, mode="nearest")
    front = _placed(machine.front_m, line[:, :2], heading)
    pivot = line[:, :2] - machine.joint_to_front_m * np.column_stack([np.cos(heading), np.sin(heading)])
    rear_heading = heading - joint
    axle = pivot - machine.joint_to_rear_m * np.column_stack([np.cos(rear_heading), np.sin(rear_heading)])
    rear = _placed(machine.rear_m, axle, rear_heading)
    # Behind its first metres the rear body is still in the node before, where its way is another.
    begun = int(min((machine.joint_to_front_m + machine.joint_to_rear_m + 3.0) / max(step, 1e-6), len(line) - 1))
    return min(walls.clearance_m(front.reshape(-1, 2)), walls.clearance_m(rear[begun:].reshape(-1, 2)))


def _placed(outline_m: FloatArray, at_m: FloatArray, heading: FloatArray) -> FloatArray:
    """Return outlines (N, K, 2) at places (N, 2)."""
    c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x = at_m[:, :1] + c * outline_m[None, :, 0] - s * outline_m[None, :, 1]
    y = at_m[:, 1:2] + s * outline_m[None, :, 0] + c * outline_m[None, :, 1]
    return np.stack([x, y], axis=-1)


def _outline(machine: Machine, frame: str) -> FloatArray:
    """Return points (N, 2) around the boxes of a body, each 0.4 m."""
    parts: list[npt.NDArray[np.float64]] = []
    for low, high in machine.boxes(frame):
        corners = np.array(
            [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]], [low[0], low[1]]]
        )
        parts.append(resampled(corners, _OUTLINE_M))
    return np.concatenate(parts) if parts else np.zeros((1, 2))
