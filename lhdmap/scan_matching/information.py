"""How well a match fixes a pose: information in other axes, with the rest unknown, with one axis less sure."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray


@nb.njit(cache=True)
def body_information(H_map: FloatArray, heading_rad: float) -> FloatArray:
    """Return H (3, 3) in the body's axes."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.ascontiguousarray(R.T) @ np.ascontiguousarray(H_map) @ R


@nb.njit(cache=True)
def marginal_information(H: FloatArray) -> FloatArray:
    """Return for each axis the information left when the other two are unknown: 1 / diag(H^-1), shape (3,).

    A direction that only shows together with another (along and heading in a bend) counts as unobserved here.
    """
    out = np.zeros(3)
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        a, b, d = H[i, i] + 1e-9, H[i, j], H[j, j] + 1e-9
        u, v = H[axis, i], H[axis, j]
        out[axis] = max(H[axis, axis] - (u * u * d - 2.0 * u * v * b + v * v * a) / (a * d - b * b), 0.0)
    return out


def inflated(covariance: FloatArray, axis: int, factor: float) -> FloatArray:
    """Return a covariance (3, 3) with the variance of one axis times a factor, correlations kept."""
    scale = np.ones(3)
    scale[axis] = math.sqrt(factor)
    return covariance * np.outer(scale, scale)
