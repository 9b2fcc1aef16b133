"""The kernel that makes a scanner's rays: the machine's pose at each beam's time, and its own body in the way."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.driving import TABLE_RATE_HZ

# What is static in a rig, as the kernel takes it: mount (4, 4), whether on the rear body, joint lengths (2,), boxes of
# the front and of the rear body, shape (N, 2, 3) each.
RigArrays = tuple[FloatArray, bool, FloatArray, FloatArray, FloatArray]


@nb.njit(cache=True)
def _pose(table: FloatArray, time_s: float) -> tuple[FloatArray, float]:
    """Return T_map_base (4, 4) and the articulation (rad) at a time, linear between the rows of the table."""
    position = min(max(time_s * TABLE_RATE_HZ, 0.0), table.shape[0] - 1.0)
    i = min(int(position), table.shape[0] - 2)
    row = table[i] * (1.0 - (position - i)) + table[i + 1] * (position - i)
    cr, sr, cp, sp = math.cos(row[3]), math.sin(row[3]), math.cos(row[4]), math.sin(row[4])
    cy, sy = math.cos(row[5]), math.sin(row[5])
    T = np.eye(4)
    T[0, 0], T[0, 1], T[0, 2], T[0, 3] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, row[0]
    T[1, 0], T[1, 1], T[1, 2], T[1, 3] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, row[1]
    T[2, 0], T[2, 1], T[2, 2], T[2, 3] = -sp, cp * sr, cp * cr, row[2]
    return T, row[6]


@nb.njit(cache=True)
def _rear_in_base(bend_rad: float, joint_m: FloatArray) -> FloatArray:
    """Return T_base_rear (4, 4); the same as `lhdmap.kinematics.T_base_rear`."""
    c, s = math.cos(bend_rad), math.sin(bend_rad)
    T = np.eye(4)
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, s, -s, c
    T[0, 3], T[1, 3] = -joint_m[0] - joint_m[1] * c, joint_m[1] * s
    return T


@nb.njit(cache=True)
def _rigid_inverse(T: FloatArray) -> FloatArray:
    out = np.eye(4)
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = -out[:3, :3] @ np.ascontiguousarray(T[:3, 3])
    return out


@nb.njit(cache=True)
def _into_boxes(T_body_scanner: FloatArray, c: float, s: float, boxes: FloatArray) -> float:
    """Return the range at which beam (c, s) enters a box, inf for none; a box around the scanner does not count."""
    nearest = math.inf
    for k in range(boxes.shape[0]):
        enter, leave = -math.inf, math.inf
        for axis in range(3):
            start = T_body_scanner[axis, 3]
            slope = T_body_scanner[axis, 0] * c + T_body_scanner[axis, 1] * s
            slope = slope if abs(slope) > 1e-12 else 1e-12
            a, b = (boxes[k, 0, axis] - start) / slope, (boxes[k, 1, axis] - start) / slope
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        if 0.0 < enter <= leave:
            nearest = min(nearest, enter)
    return nearest


@nb.njit(cache=True, nogil=True)
def fill_rays(
    table: FloatArray,
    stamps_s: FloatArray,
    beams: tuple[FloatArray, FloatArray],
    rig: RigArrays,
    origin_m: FloatArray,
    rays: Float32Array,
    blocked_m: Float32Array,
) -> None:
    """Fill `rays` (S·N, 6), origin less `origin_m` and direction in `map`, and `blocked_m` (S·N,), to the own body.

    `table` (M, 7) is a motion's, `stamps_s` (S,) the times of the first beams, `beams` angles and delays (N,).
    """
    T_parent_scanner, on_rear, joint_m, front_boxes, rear_boxes = rig
    angles, times = beams
    T_base_scanner = T_rear_scanner = T_map_scanner = np.eye(4)
    row = 0
    for k in range(stamps_s.size):
        for i in range(angles.size):
            if i == 0 or times[i] != times[i - 1]:
                T_map_base, bend = _pose(table, stamps_s[k] + times[i])
                T_base_rear = _rear_in_base(bend, joint_m)
                T_base_scanner = T_base_rear @ T_parent_scanner if on_rear else T_parent_scanner
                T_rear_scanner = _rigid_inverse(T_base_rear) @ T_base_scanner
                T_map_scanner = T_map_base @ T_base_scanner
            c, s = math.cos(angles[i]), math.sin(angles[i])
            for axis in range(3):
                rays[row, axis] = T_map_scanner[axis, 3] - origin_m[axis]
                rays[row, 3 + axis] = c * T_map_scanner[axis, 0] + s * T_map_scanner[axis, 1]
            front = _into_boxes(T_base_scanner, c, s, front_boxes)
            blocked_m[row] = min(front, _into_boxes(T_rear_scanner, c, s, rear_boxes))
            row += 1
