"""Planar rigid motions as arrays (x, y, heading): metres and radians, shape (3,) or (N, 3)."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray


@nb.njit(cache=True)
def wrap(angle_rad: float) -> float:
    """Return the angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@nb.njit(cache=True)
def compose(pose_a_b: FloatArray, pose_b_c: FloatArray) -> FloatArray:
    """Return pose_a_c = pose_a_b * pose_b_c; all shape (3,)."""
    c, s = math.cos(pose_a_b[2]), math.sin(pose_a_b[2])
    return np.array(
        [
            pose_a_b[0] + c * pose_b_c[0] - s * pose_b_c[1],
            pose_a_b[1] + s * pose_b_c[0] + c * pose_b_c[1],
            wrap(pose_a_b[2] + pose_b_c[2]),
        ]
    )


@nb.njit(cache=True)
def inverse(pose_a_b: FloatArray) -> FloatArray:
    """Return pose_b_a; shape (3,)."""
    c, s = math.cos(pose_a_b[2]), math.sin(pose_a_b[2])
    return np.array([-c * pose_a_b[0] - s * pose_a_b[1], s * pose_a_b[0] - c * pose_a_b[1], -pose_a_b[2]])


@nb.njit(cache=True)
def between(pose_w_a: FloatArray, pose_w_b: FloatArray) -> FloatArray:
    """Return pose_a_b from two poses in one frame; shape (3,)."""
    return compose(inverse(pose_w_a), pose_w_b)


@nb.njit(cache=True)
def transform(pose_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Return points given in b, shape (N, 2) or (N, 3), in frame a; heights stay."""
    c, s = math.cos(pose_a_b[2]), math.sin(pose_a_b[2])
    out = points_b.copy()
    for i in range(points_b.shape[0]):
        out[i, 0] = pose_a_b[0] + c * points_b[i, 0] - s * points_b[i, 1]
        out[i, 1] = pose_a_b[1] + s * points_b[i, 0] + c * points_b[i, 1]
    return out


@nb.njit(cache=True)
def adjoint(pose_a_b: FloatArray) -> FloatArray:
    """Return the matrix (3, 3) that carries a small motion from the axes of b to those of a: T exp(e) = exp(adjoint e) T."""
    c, s = math.cos(pose_a_b[2]), math.sin(pose_a_b[2])
    return np.array([[c, -s, pose_a_b[1]], [s, c, -pose_a_b[0]], [0.0, 0.0, 1.0]])


@nb.njit(cache=True)
def composed_covariance(covariance_a_b: FloatArray, pose_b_c: FloatArray, covariance_b_c: FloatArray) -> FloatArray:
    """Return the covariance (3, 3) of pose_a_c from those of pose_a_b and pose_b_c, independent, each in the axes of its end."""
    carried = adjoint(inverse(pose_b_c))
    return carried @ covariance_a_b @ carried.T + covariance_b_c
