"""A map and a drive that lies in it, as one: path, views and cloud of both in the map's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.geometry import se3
from lhdmap.integration.cloud import GridCloud
from lhdmap.messages import FloatArray
from lhdmap.smoothing.smoother import Correction, corrected
from lhdmap.topology.views import View
from lhdmap.trajectory import Trajectory

PLANAR_AND_HEIGHT = [0, 1, 2, 5]
_VOXEL_M = 0.1
_GONE_M = 0.35  # around a wall that went
_OVER_FLOOR_M, _UNDER_ROOF_M = 0.3, 3.0


def poses_of(trajectory: Trajectory) -> FloatArray:
    """Return the poses (N, 6: x, y, z, roll, pitch, heading) of a trajectory, headings unwrapped."""
    x, y, z, w = trajectory.quaternions_xyzw.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return np.column_stack([trajectory.positions_m, roll, pitch, heading])


def trajectory_of(stamps_ns: npt.NDArray[np.int64], poses: FloatArray) -> Trajectory:
    """Return poses (N, 6) as a trajectory."""
    return Trajectory(stamps_ns, poses[:, :3].copy(), se3.quaternions_from_rpy(*poses[:, 3:].T))


def view_poses(trajectory: Trajectory, views: Sequence[View]) -> FloatArray:
    """Return the poses (N, 4: x, y, z, heading) of a map's views."""
    poses = poses_of(trajectory)[:, PLANAR_AND_HEIGHT]
    since = (trajectory.stamps_ns - trajectory.stamps_ns[0]).astype(float)
    at = np.array([view.time_ns - int(trajectory.stamps_ns[0]) for view in views], dtype=float)
    return np.column_stack([np.interp(at, since, column) for column in poses.T])


def moved_trajectory(trajectory: Trajectory, correction: Correction) -> Trajectory:
    """Return a drive's trajectory in the map's frame."""
    return trajectory_of(trajectory.stamps_ns, corrected(poses_of(trajectory), trajectory.stamps_ns, correction))


def moved_cloud(cloud: GridCloud, correction: Correction) -> GridCloud:
    """Return a drive's cloud in the map's frame: each point moves as the machine did when it was measured."""
    stamps = _stamps(cloud, correction)
    points = np.zeros((len(cloud.points_m), 6))
    points[:, :3] = cloud.points_m
    moved = corrected(points, stamps, correction)
    normals = cloud.normals
    if normals is not None:
        c, s = np.cos(moved[:, 5]), np.sin(moved[:, 5])
        turned = np.column_stack([c * normals[:, 0] - s * normals[:, 1], s * normals[:, 0] + c * normals[:, 1]])
        normals = np.column_stack([turned, normals[:, 2]]).astype(np.float32)
    return replace(cloud, points_m=moved[:, :3].astype(np.float32), normals=normals, viewpoints_m=None)


def joined_clouds(known: GridCloud, drive: GridCloud, went_m: FloatArray, path: FloatArray) -> GridCloud:
    """Return the map's cloud without the walls that went (N, 2), and what the drive saw where it has no point.

    `path` (M, 4): of both drives; its heights tell floor and roof.
    """
    kept = np.ones(len(known.points_m), bool)
    if len(went_m):
        apart, _ = KDTree(went_m).query(known.points_m[:, :2], distance_upper_bound=_GONE_M)
        floor = path[KDTree(path[:, :2]).query(known.points_m[:, :2])[1], 2]
        above = known.points_m[:, 2] - floor
        kept = ~(np.isfinite(apart) & (above > _OVER_FLOOR_M) & (above < _UNDER_ROOF_M))
    new = ~np.isin(_voxels(drive.points_m), _voxels(known.points_m[kept]))
    stamps = None
    if known.stamps_ns is not None and drive.stamps_ns is not None:
        stamps = np.concatenate([known.stamps_ns[kept], drive.stamps_ns[new]])
    return GridCloud(
        points_m=np.concatenate([known.points_m[kept], drive.points_m[new]]),
        normals=_both(known.normals, drive.normals, kept, new),
        curvature=_both(known.curvature, drive.curvature, kept, new),
        stamps_ns=stamps,
    )


def _stamps(cloud: GridCloud, correction: Correction) -> npt.NDArray[np.int64]:
    if cloud.stamps_ns is not None:
        return cloud.stamps_ns
    return np.full(len(cloud.points_m), correction.times_ns[0], dtype=np.int64)


def _both(
    known: npt.NDArray[np.float32] | None,
    drive: npt.NDArray[np.float32] | None,
    kept: npt.NDArray[np.bool_],
    new: npt.NDArray[np.bool_],
) -> npt.NDArray[np.float32] | None:
    if known is None or drive is None:
        return None
    return np.concatenate([known[kept], drive[new]])


def _voxels(points_m: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
    """Return a number for the voxel of each point (N, 3)."""
    cells = np.floor(points_m.astype(float) / _VOXEL_M).astype(np.int64) + (1 << 20)
    numbers: npt.NDArray[np.int64] = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
    return numbers
