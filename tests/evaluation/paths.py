"""Trajectories of known shape for the tests of the evaluation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from lhdmap.geometry.se3 import quaternions_from_rpy
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 20_000_000


def trajectory(positions_m: FloatArray, rpy: FloatArray, stamps_ns: npt.ArrayLike | None = None) -> Trajectory:
    """Return poses at positions (N, 3) with roll, pitch, yaw (N, 3), 50 Hz unless stamps are given."""
    stamps = START_NS + PERIOD_NS * np.arange(len(positions_m)) if stamps_ns is None else np.asarray(stamps_ns)
    return Trajectory(stamps.astype(np.int64), np.asarray(positions_m, dtype=float), quaternions_from_rpy(*rpy.T))


def straight(length_m: float, step_m: float = 0.05, scale: float = 1.0) -> Trajectory:
    """Return a straight level drive along x; `scale` stretches it."""
    s = np.arange(round(length_m / step_m) + 1) * step_m
    return trajectory(np.column_stack([scale * s, 0 * s, 0 * s]), np.zeros((len(s), 3)))


def arc(radius_m: float, length_m: float, step_m: float = 0.05, bias_rad_per_m: float = 0.0) -> Trajectory:
    """Return a drive on a circle to the left; its heading (and so its path) may have a constant bias per metre."""
    s = np.arange(round(length_m / step_m) + 1) * step_m
    rate = 1.0 / radius_m + bias_rad_per_m
    heading = rate * s
    positions = np.column_stack([np.sin(heading), 1.0 - np.cos(heading), 0 * s]) / rate
    return trajectory(positions, np.column_stack([0 * s, 0 * s, heading]))


def wandering(seed: int, poses: int = 400) -> Trajectory:
    """Return a random but smooth drive in space, with roll, pitch and every heading."""
    rng = np.random.default_rng(seed)
    rpy = np.cumsum(rng.normal(0, [0.002, 0.002, 0.02], (poses, 3)), axis=0)
    ahead = np.column_stack([np.cos(rpy[:, 2]), np.sin(rpy[:, 2]), -np.sin(rpy[:, 1])])
    return trajectory(np.cumsum(0.1 * ahead, axis=0), rpy)


def disturbed(path: Trajectory, seed: int, position_m: float = 0.02, angle_rad: float = 0.003) -> Trajectory:
    """Return the path with independent noise on every pose."""
    from lhdmap.geometry.se3 import rpy_from_quaternions

    rng = np.random.default_rng(seed)
    n = len(path.stamps_ns)
    rpy = rpy_from_quaternions(path.quaternions_xyzw) + rng.normal(0, angle_rad, (n, 3))
    return trajectory(path.positions_m + rng.normal(0, position_m, (n, 3)), rpy, path.stamps_ns)


def moved(path: Trajectory, rpy: tuple[float, float, float], offset_m: tuple[float, float, float]) -> Trajectory:
    """Return the path seen from another frame."""
    from lhdmap.evaluation.poses import poses_from_quaternions
    from lhdmap.geometry.se3 import from_rpy

    T = from_rpy(*rpy, offset_m)
    rotations = T[:3, :3] @ poses_from_quaternions(path.positions_m, path.quaternions_xyzw).rotations
    angles = np.column_stack(
        [
            np.arctan2(rotations[:, 2, 1], rotations[:, 2, 2]),
            -np.arcsin(np.clip(rotations[:, 2, 0], -1, 1)),
            np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0]),
        ]
    )
    return trajectory(path.positions_m @ T[:3, :3].T + T[:3, 3], angles, path.stamps_ns)


def part(path: Trajectory, rows: slice | npt.NDArray[np.int64]) -> Trajectory:
    """Return the poses of the path at `rows` (a slice or an array of rows)."""
    return Trajectory(path.stamps_ns[rows], path.positions_m[rows], path.quaternions_xyzw[rows])
