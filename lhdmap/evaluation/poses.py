"""Stacks of poses for the evaluation: positions (N, 3) in metres and rotation matrices (N, 3, 3), in one frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray

JUMP_BACK_NS = 1_000_000_000
"""Steps back of stamps that are shorter are scatter of a clock, as in CARMEN's Intel log: the path goes on over them."""


class Poses(NamedTuple):
    """N rigid motions: `positions_m` (N, 3) and `rotations` (N, 3, 3)."""

    positions_m: FloatArray
    rotations: FloatArray


def poses_from_quaternions(positions_m: FloatArray, quaternions_xyzw: FloatArray) -> Poses:
    """Return poses of positions (N, 3) and quaternions x y z w (N, 4), which need not be of unit length.

    Raises:
        InputError: a quaternion is zero or not finite.
    """
    norms = np.linalg.norm(quaternions_xyzw, axis=1, keepdims=True)
    bad = np.flatnonzero(~(norms[:, 0] > 1e-6) | ~np.isfinite(norms[:, 0]))
    if len(bad):
        raise InputError(f"pose {bad[0]}: quaternion {quaternions_xyzw[bad[0]]} is no rotation")
    x, y, z, w = (quaternions_xyzw / norms).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return Poses(np.asarray(positions_m, dtype=float), np.moveaxis(np.array(rows), -1, 0))


def poses_from_plane(xy_heading: FloatArray) -> Poses:
    """Return poses of planar ones (N, 3): x, y in metres, heading in radians."""
    positions = np.column_stack([xy_heading[:, :2], np.zeros(len(xy_heading))])
    return Poses(positions, yaw_rotations(xy_heading[:, 2]))


def yaw_rotations(heading_rad: FloatArray) -> FloatArray:
    """Return rotations about z, shape (N, 3, 3), of headings (N,)."""
    out = np.zeros((len(heading_rad), 3, 3))
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    out[:, 0, 0], out[:, 0, 1], out[:, 1, 0], out[:, 1, 1], out[:, 2, 2] = c, -s, s, c, 1.0
    return out


def headings(poses: Poses) -> FloatArray:
    """Return the heading of each pose (N,), radians: the direction of its x axis seen from above."""
    return np.arctan2(poses.rotations[:, 1, 0], poses.rotations[:, 0, 0])


def flattened(poses: Poses) -> Poses:
    """Return the poses as seen from above: height, roll and pitch dropped, x, y and heading kept."""
    return Poses(poses.positions_m * [1.0, 1.0, 0.0], yaw_rotations(headings(poses)))


def taken(poses: Poses, rows: npt.NDArray[np.int64]) -> Poses:
    """Return the poses at `rows`."""
    return Poses(poses.positions_m[rows], poses.rotations[rows])


def between(T_w_a: Poses, T_w_b: Poses) -> Poses:
    """Return T_a_b row by row; independent of the frame w."""
    inverse_a = np.swapaxes(T_w_a.rotations, 1, 2)
    offset = T_w_b.positions_m - T_w_a.positions_m
    return Poses(np.einsum("nij,nj->ni", inverse_a, offset), inverse_a @ T_w_b.rotations)


def angles(rotations: FloatArray) -> FloatArray:
    """Return the rotation angle of each matrix, radians in [0, pi]; exact for tiny angles as well.

    The sine comes from the skew part and the cosine from the trace: arccos alone loses everything below 1e-8 rad.
    """
    skew = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=-1,
    )
    return np.arctan2(np.linalg.norm(skew, axis=1), np.trace(rotations, axis1=1, axis2=2) - 1.0)


def distances_along(positions_m: FloatArray, stamps_ns: npt.NDArray[np.int64] | None = None) -> FloatArray:
    """Return the path length from the first position to each (N,), metres.

    Where stamps (N,) are given, nothing is counted from one pose to the next where time jumps back.
    """
    steps_m = np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
    if stamps_ns is not None:
        steps_m[np.diff(stamps_ns) < -JUMP_BACK_NS] = 0.0
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def yaw_rotation(heading_rad: float) -> FloatArray:
    """Return the rotation about z, shape (3, 3)."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
