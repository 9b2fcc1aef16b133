"""Where the bodies of a machine are: its boxes in `map`, the bucket's where boom and bucket hold it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.machine import Machine
from lhdmap.machine_sections import Linkage
from lhdmap.messages import FloatArray
from lhdmap.simulation.vehicle.state import VehicleState


class Boxes(NamedTuple):
    """Oriented boxes in `map`: names, centres (K, 3), axes as columns (K, 3, 3), half lengths along them (K, 3), m."""

    names: tuple[str, ...]
    centre_m: FloatArray
    axes: FloatArray
    half_m: FloatArray


class Bodies:
    """The boxes of a machine: fixed to the front or the rear body, but for the bucket's."""

    def __init__(self, machine: Machine) -> None:
        size = machine.dimensions
        self._linkage = machine.linkage
        self._joint_m = (size.joint_to_front_axle_m, size.joint_to_rear_axle_m)
        self._names = tuple(machine.bodies)
        bodies = machine.bodies.values()
        self._front = np.array([body.frame == "base_link" for body in bodies])
        self._corners = np.array([(body.min_m, body.max_m) for body in bodies], dtype=float).reshape(-1, 2, 3)
        self._buckets = [i for i, name in enumerate(self._names) if "bucket" in name and self._front[i]]
        self._posture = (self._linkage.boom_min_rad, self._linkage.bucket_max_rad)
        self._held = self._corners

    def corners(self, boom_rad: float, bucket_rad: float) -> FloatArray:
        """Return the lower and upper corner of each box in the frame of its body, shape (K, 2, 3), m.

        The bucket's box stays upright: it has its file's size in tramming posture, and each side moves as far as
        that side of the bucket's outline. It has the whole bucket in it in any posture, not the arms of a raised boom.
        """
        if (boom_rad, bucket_rad) != self._posture:
            self._posture, self._held = (boom_rad, bucket_rad), self._corners.copy()
            self._held[self._buckets] += _moved_sides(self._linkage, boom_rad, bucket_rad)
        return self._held

    def boxes(self, state: VehicleState) -> Boxes:
        """Return the boxes in `map`."""
        corners = self.corners(state.boom_rad, state.bucket_rad)
        centre, axes, half = _placed(np.array(state[1:8]), self._joint_m, self._front, corners)
        return Boxes(self._names, centre, axes, half)


def body_boxes(machine: Machine, state: VehicleState) -> Boxes:
    """Return the boxes of all bodies of `machine` in `map`; `Bodies` is for many states."""
    return Bodies(machine).boxes(state)


def moved_at_most_m(before: Boxes, now: Boxes) -> float:
    """Return how far any point of the boxes is at most from the same box as it was `before`, metres."""
    return float(_moved_at_most(before[1], before[2], before[3], now[1], now[2], now[3]))


def bucket_outline(linkage: Linkage, boom_rad: float, bucket_rad: float) -> FloatArray:
    """Return pin, lip, heel and upper edge of the bucket as x, z in `base_link`, shape (4, 2), m."""
    lifted, tilted = boom_rad - linkage.boom_min_rad, bucket_rad - linkage.bucket_max_rad
    arm = linkage.boom_angle_rad + lifted
    angle = linkage.bucket_angle_rad + tilted + linkage.boom_to_bucket * lifted
    pin = np.array(linkage.pivot_m) + linkage.boom_m * np.array([math.cos(arm), math.sin(arm)])
    c, s = math.cos(angle), math.sin(angle)
    points = np.array([(0.0, 0.0), linkage.lip_m, linkage.heel_m, linkage.top_m])
    return pin + points @ np.array([[c, s], [-s, c]])


def _moved_sides(linkage: Linkage, boom_rad: float, bucket_rad: float) -> FloatArray:
    """Return how far the sides of the bucket's box are from where they are when tramming, shape (2, 3), m."""
    now = bucket_outline(linkage, boom_rad, bucket_rad)
    tramming = bucket_outline(linkage, linkage.boom_min_rad, linkage.bucket_max_rad)
    moved = np.zeros((2, 3))
    moved[0, ::2] = now.min(axis=0) - tramming.min(axis=0)
    moved[1, ::2] = now.max(axis=0) - tramming.max(axis=0)
    return moved


@nb.njit(cache=True, nogil=True)
def _placed(
    pose: FloatArray, joint_m: tuple[float, float], front: FloatArray, corners: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return centres, axes and half lengths of boxes; `pose` is x, y, z, roll, pitch, yaw, articulation."""
    cr, sr, cp, sp = math.cos(pose[3]), math.sin(pose[3]), math.cos(pose[4]), math.sin(pose[4])
    cy, sy, cb, sb = math.cos(pose[5]), math.sin(pose[5]), math.cos(pose[6]), math.sin(pose[6])
    x_axis = (cy * cp, sy * cp, -sp)
    y_axis = (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr)
    z_axis = (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr)
    rear_x, rear_y = -joint_m[0] - joint_m[1] * cb, joint_m[1] * sb
    count = len(corners)
    centre, axes, half = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    for b in range(count):
        c, s, ahead, left = (1.0, 0.0, 0.0, 0.0) if front[b] else (cb, sb, rear_x, rear_y)
        for k in range(3):
            axes[b, k, 0] = c * x_axis[k] - s * y_axis[k]
            axes[b, k, 1] = s * x_axis[k] + c * y_axis[k]
            axes[b, k, 2] = z_axis[k]
            half[b, k] = 0.5 * (corners[b, 1, k] - corners[b, 0, k])
            centre[b, k] = pose[k] + ahead * x_axis[k] + left * y_axis[k]
            for j in range(3):
                centre[b, k] += axes[b, k, j] * 0.5 * (corners[b, 0, j] + corners[b, 1, j])
    return centre, axes, half


@nb.njit(cache=True, nogil=True)
def _moved_at_most(
    centre0: FloatArray, axes0: FloatArray, half0: FloatArray, centre: FloatArray, axes: FloatArray, half: FloatArray
) -> float:
    """Return the largest of the boxes' shifts: of the centre, of the ends of the axes, and of the sides that have grown."""
    most = 0.0
    for b in range(len(centre)):
        square = 0.0
        for k in range(3):
            square += (centre[b, k] - centre0[b, k]) ** 2
        shift = math.sqrt(square)
        for j in range(3):
            square = 0.0
            for k in range(3):
                square += (axes[b, k, j] - axes0[b, k, j]) ** 2
            shift += math.sqrt(square) * half[b, j] + max(half[b, j] - half0[b, j], 0.0)
        most = max(most, shift)
    return most
