"""Both bodies against wall points: Eq. (6) of the autonomous-loading paper, and sweeps of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.geometry.articulated import rear_axle
from lhdmap.messages import FloatArray

_TURN_STEP_RAD, _WAY_STEP_M = math.radians(2.0), 0.4


class Box(NamedTuple):
    """A box in plan: its bottom left corner (2,), S to the top left one, B to the bottom right one; metres."""

    corner_m: FloatArray
    S_m: FloatArray
    B_m: FloatArray


def inside(box: Box, points_m: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which points (N, 2) are inside a box, bool (N,): 0 < S·d < |S|² and 0 < B·d < |B|², Eq. (6)."""
    d = points_m - box.corner_m
    along, across = d @ box.S_m, d @ box.B_m
    found: npt.NDArray[np.bool_] = (
        (along > 0.0) & (along < box.S_m @ box.S_m) & (across > 0.0) & (across < box.B_m @ box.B_m)
    )
    return found


def box_at(low_high_m: FloatArray, pose: FloatArray, margin_m: float) -> Box:
    """Return a body's box (2, 2; low, high) at a pose (3,), widened by a margin: bottom is its tail, top its nose."""
    (x0, y0), (x1, y1) = low_high_m
    c, s = math.cos(pose[2]), math.sin(pose[2])
    rotation = np.array([[c, -s], [s, c]])
    corner = pose[:2] + rotation @ np.array([x0 - margin_m, y1 + margin_m])
    S = rotation @ np.array([x1 - x0 + 2.0 * margin_m, 0.0])
    B = rotation @ np.array([0.0, y0 - y1 - 2.0 * margin_m])
    return Box(corner, S, B)


class Posture(NamedTuple):
    """Where `base_link` is (3,), in its frame of now, and the joint."""

    base: FloatArray
    bend_rad: float


def rear_of(posture: Posture, model: DriveModel) -> FloatArray:
    """Return the pose (3,) of `rear_link`."""
    x, y, heading = posture.base.tolist()
    return np.array(rear_axle(x, y, heading, posture.bend_rad, model.front_m, model.rear_m))


def turned(bend_rad: float, to_rad: float, model: DriveModel) -> float:
    """Return by how much the front body turns (rad) while the joint alone goes from one angle to another: Eq. (1), v = 0."""
    steps = max(math.ceil(abs(to_rad - bend_rad) / _TURN_STEP_RAD), 1)
    step = (to_rad - bend_rad) / steps
    middles = bend_rad + step * (np.arange(steps) + 0.5)
    return float((model.rear_m * step / (model.front_m * np.cos(middles) + model.rear_m)).sum())


def turning(bend_rad: float, to_rad: float, model: DriveModel) -> Iterator[Posture]:
    """Yield the postures while the joint alone turns; the front axle stays where it is."""
    steps = max(math.ceil(abs(to_rad - bend_rad) / _TURN_STEP_RAD), 1)
    for k in range(1, steps + 1):
        bend = bend_rad + (to_rad - bend_rad) * k / steps
        yield Posture(np.array([0.0, 0.0, turned(bend_rad, bend, model)]), bend)


def charging(start: Posture, curvature: float, way_m: float) -> Iterator[Posture]:
    """Yield the postures of a charge over a way of the front axle with the joint held: Eq. (3)."""
    steps = max(math.ceil(way_m / _WAY_STEP_M), 1)
    x, y, heading = start.base.tolist()
    for k in range(1, steps + 1):
        turn = curvature * way_m * k / steps
        chord = way_m * k / steps * float(np.sinc(0.5 * turn / math.pi))
        at = heading + 0.5 * turn
        yield Posture(np.array([x + chord * math.cos(at), y + chord * math.sin(at), heading + turn]), start.bend_rad)


def touches(posture: Posture, points_m: FloatArray, bodies: Bodies, model: DriveModel, margin_m: float) -> bool:
    """Return whether a wall point (N, 2), `base_link` of now, is inside the box of either body."""
    front = box_at(bodies.front_box_m, posture.base, margin_m)
    rear = box_at(bodies.rear_box_m, rear_of(posture, model), margin_m)
    return bool(inside(front, points_m).any() or inside(rear, points_m).any())
