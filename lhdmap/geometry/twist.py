"""Exponential and logarithm of rigid motions in space.

Twists are (rotation, translation) in body axes, shape (6,): rad and m, or rad/s and m/s. Errors of a pose are such twists on its
right: T_true = T exp(error).
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray

_SMALL_RAD = 1e-4  # below it the series of three terms are exact to the last bit
_NO_SINE = 1e-9  # a sine below it gives no axis: no turn, or half a turn


def skew(vectors: FloatArray) -> FloatArray:
    """Return the cross product matrix of a vector, shape (3, 3)."""
    x, y, z = vectors
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def exp(twist: FloatArray) -> FloatArray:
    """Return the motion (4, 4) of a twist (6,): rotation vector and translation."""
    angle = float(np.linalg.norm(twist[:3]))
    K = skew(twist[:3])
    a, b, c = _series(angle)
    T = np.eye(4)
    T[:3, :3] += a * K + b * K @ K
    T[:3, 3] = (np.eye(3) + b * K + c * K @ K) @ twist[3:]
    return T


def log(T: FloatArray) -> FloatArray:
    """Return the twist (6,) of a motion (4, 4); its angle is below pi."""
    R = T[:3, :3]
    axis = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, 0.5 * (float(np.trace(R)) - 1.0))
    if sine > _NO_SINE:
        axis = axis * (angle / sine)
    elif angle > 1.0:  # half a turn: the axis is the eigenvector of the symmetric part
        axis = angle * np.linalg.eigh(R + R.T)[1][:, 2]
    K = skew(axis)
    _, b, c = _series(angle)
    return np.concatenate([axis, np.linalg.solve(np.eye(3) + b * K + c * K @ K, T[:3, 3])])


def _series(angle: float) -> tuple[float, float, float]:
    """Return sin(a)/a, (1 - cos a)/a² and (a - sin a)/a³."""
    if angle < _SMALL_RAD:
        return 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    return math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3


def orthonormal(T: FloatArray) -> FloatArray:
    """Return the pose (4, 4) with its rotation made exact: products of many rotations drift away from one."""
    U, _, Vt = np.linalg.svd(T[:3, :3])
    out = T.copy()
    out[:3, :3] = U @ Vt
    return out


def adjoint(T_a_b: FloatArray) -> FloatArray:
    """Return the matrix (6, 6) that takes twists in b to twists in a."""
    R = T_a_b[:3, :3]
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[3:, :3] = skew(T_a_b[:3, 3]) @ R
    return out
