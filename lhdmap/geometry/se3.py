"""Rigid motions in space: 4 x 4 matrices, quaternions (x, y, z, w), roll-pitch-yaw in REP 103 order (Rz Ry Rx)."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray


def from_rpy(
    roll_rad: float, pitch_rad: float, yaw_rad: float, position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> FloatArray:
    """Return the 4 x 4 pose with rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr, cp, sp = math.cos(roll_rad), math.sin(roll_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, position_m[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, position_m[1]],
            [-sp, cp * sr, cp * cr, position_m[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def to_rpy(T_a_b: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (rad) of a 4 x 4 pose or 3 x 3 rotation."""
    R = T_a_b
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def from_quaternion(quaternion_xyzw: FloatArray, position_m: FloatArray) -> FloatArray:
    """Return the 4 x 4 pose of a quaternion (need not be of unit length) and a position.

    Raises:
        ValueError: the quaternion is zero or not finite.
    """
    norm = float(np.linalg.norm(quaternion_xyzw))
    if not math.isfinite(norm) or norm < 1e-6:
        raise ValueError(f"quaternion {quaternion_xyzw} is no rotation")
    x, y, z, w = np.asarray(quaternion_xyzw, dtype=float) / norm
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = position_m
    return T


def from_quaternions(quaternions_xyzw: FloatArray, positions_m: FloatArray) -> FloatArray:
    """Return the poses, shape (N, 4, 4), of quaternions of any length, shape (N, 4), and positions, shape (N, 3)."""
    norms = np.linalg.norm(quaternions_xyzw, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(np.asarray(quaternions_xyzw, dtype=float) / norms, -1, 0)
    T = np.zeros((len(x), 4, 4))
    T[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1)
    T[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1)
    T[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1)
    T[:, :3, 3], T[:, 3, 3] = positions_m, 1.0
    return T


def quaternions_from_rpy(roll_rad: FloatArray, pitch_rad: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """Return quaternions x y z w, shape (N, 4), of roll, pitch and yaw, each of shape (N,)."""
    cr, sr = np.cos(roll_rad / 2), np.sin(roll_rad / 2)
    cp, sp = np.cos(pitch_rad / 2), np.sin(pitch_rad / 2)
    cy, sy = np.cos(yaw_rad / 2), np.sin(yaw_rad / 2)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def quaternion_from_rpy(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """Return the quaternion x y z w, shape (4,), of one roll, pitch and yaw."""
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    return np.array([x, y, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy])


def rpy_from_quaternions(quaternions_xyzw: FloatArray) -> FloatArray:
    """Return roll, pitch, yaw, shape (N, 3), of quaternions x y z w, shape (N, 4)."""
    x, y, z, w = np.moveaxis(np.asarray(quaternions_xyzw, dtype=float), -1, 0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)


def roll_pitch(x: float, y: float, z: float, w: float) -> tuple[float, float]:
    """Return roll and pitch (rad) of one quaternion (need not be of unit length)."""
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    roll = math.atan2(scale * (w * x + y * z), 1.0 - scale * (x * x + y * y))
    return roll, math.asin(min(max(scale * (w * y - z * x), -1.0), 1.0))


def inverse(T_a_b: FloatArray) -> FloatArray:
    """Return T_b_a of a 4 x 4 pose."""
    T = np.eye(4)
    T[:3, :3] = T_a_b[:3, :3].T
    T[:3, 3] = -T_a_b[:3, :3].T @ T_a_b[:3, 3]
    return T
