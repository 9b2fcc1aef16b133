"""The kernel that makes a scanner's rays: the machine's pose at each beam's time, and its own body in the way.

Poses are rows of three and four numbers each, (3, 4): the first three rows of a 4 × 4 transform.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import Float32Array, FloatArray

# What is static in a rig, as the kernel takes it: mount (4, 4), whether on the rear body, joint lengths (2,), boxes of
# the front and of the rear body, shape (N, 2, 3) each.
RigArrays = tuple[FloatArray, bool, FloatArray, FloatArray, FloatArray]


@nb.njit(cache=True)
def _map_base(rows: FloatArray, position: float, out: FloatArray) -> float:
    """Write T_map_base (3, 4) at a place between rows, linear between them, its end held; return the articulation (rad)."""
    i = min(int(position), rows.shape[0] - 1)
    j = min(i + 1, rows.shape[0] - 1)
    b = position - i if j > i else 0.0
    a = 1.0 - b
    roll, pitch = rows[i, 3] * a + rows[j, 3] * b, rows[i, 4] * a + rows[j, 4] * b
    yaw = rows[i, 5] * a + rows[j, 5] * b
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    out[0, 0], out[0, 1], out[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    out[1, 0], out[1, 1], out[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    out[2, 0], out[2, 1], out[2, 2] = -sp, cp * sr, cp * cr
    for axis in range(3):
        out[axis, 3] = rows[i, axis] * a + rows[j, axis] * b
    return rows[i, 6] * a + rows[j, 6] * b


@nb.njit(cache=True)
def _base_rear(bend_rad: float, joint_m: FloatArray, out: FloatArray) -> None:
    """Write T_base_rear (3, 4); the same as `lhdmap.kinematics.T_base_rear`."""
    c, s = math.cos(bend_rad), math.sin(bend_rad)
    out[:] = 0.0
    out[0, 0], out[0, 1], out[1, 0], out[1, 1], out[2, 2] = c, s, -s, c, 1.0
    out[0, 3], out[1, 3] = -joint_m[0] - joint_m[1] * c, joint_m[1] * s


@nb.njit(cache=True)
def _product(A: FloatArray, B: FloatArray, out: FloatArray) -> None:
    """Write A @ B."""
    for i in range(3):
        for j in range(4):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
        out[i, 3] += A[i, 3]


@nb.njit(cache=True)
def _inverse_product(A: FloatArray, B: FloatArray, out: FloatArray) -> None:
    """Write inverse(A) @ B of rigid transforms."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]
        out[i, 3] = A[0, i] * (B[0, 3] - A[0, 3]) + A[1, i] * (B[1, 3] - A[1, 3]) + A[2, i] * (B[2, 3] - A[2, 3])


@nb.njit(cache=True)
def _into_boxes(T_body_scanner: FloatArray, x: float, y: float, z: float, boxes: FloatArray) -> float:
    """Return the range at which beam (x, y, z) enters a box, inf for none; a box around the scanner does not count."""
    nearest = math.inf
    for k in range(boxes.shape[0]):
        enter, leave = -math.inf, math.inf
        for axis in range(3):
            start = T_body_scanner[axis, 3]
            slope = T_body_scanner[axis, 0] * x + T_body_scanner[axis, 1] * y + T_body_scanner[axis, 2] * z
            slope = slope if abs(slope) > 1e-12 else 1e-12
            a, b = (boxes[k, 0, axis] - start) / slope, (boxes[k, 1, axis] - start) / slope
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        if 0.0 < enter <= leave:
            nearest = min(nearest, enter)
    return nearest


@nb.njit(cache=True, nogil=True)
def fill_rays(
    rows: FloatArray,
    position: tuple[int, float],
    rate_hz: float,
    sweep: tuple[FloatArray, FloatArray],
    rig: RigArrays,
    origin_m: FloatArray,
    rays: Float32Array,
    blocked_m: Float32Array,
) -> None:
    """Fill `rays` (N, 6), origin less `origin_m` and direction in `map`, and `blocked_m` (N,), to the own body.

    `rows` (M, 20) at `rate_hz` are a history's, `position` where in them the sweep begins (row, share of the step to the
    next), `sweep` the directions (N, 3) in the scanner's frame and the delays (N,) in s.
    """
    T_parent_scanner, on_rear, joint_m, front_boxes, rear_boxes = rig
    first, share = position
    directions, times = sweep
    mount = np.ascontiguousarray(T_parent_scanner[:3])
    T_map_base, T_base_rear, T_map_scanner = np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4))
    T_base_scanner, T_rear_scanner = mount.copy(), mount.copy()
    for i in range(times.size):
        if i == 0 or times[i] != times[i - 1]:
            bend = _map_base(rows[first:], share + times[i] * rate_hz, T_map_base)
            _base_rear(bend, joint_m, T_base_rear)
            if on_rear:
                _product(T_base_rear, mount, T_base_scanner)
            else:
                _inverse_product(T_base_rear, mount, T_rear_scanner)
            _product(T_map_base, T_base_scanner, T_map_scanner)
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        for axis in range(3):
            rays[i, axis] = T_map_scanner[axis, 3] - origin_m[axis]
            rays[i, 3 + axis] = T_map_scanner[axis, 0] * x + T_map_scanner[axis, 1] * y + T_map_scanner[axis, 2] * z
        front = _into_boxes(T_base_scanner, x, y, z, front_boxes)
        blocked_m[i] = min(front, _into_boxes(T_rear_scanner, x, y, z, rear_boxes))
