"""What was mapped against the world it was simulated in: rows of a trajectory, points in the frame of the truth, distances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.pipeline.track import TrackRows
from lhdmap.trajectory import Trajectory


def rows_of(trajectory: Trajectory) -> TrackRows:
    """Return a trajectory as rows of x, y, z, roll, pitch, heading."""
    rpy = se3.rpy_from_quaternions(trajectory.quaternions_xyzw)
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    return TrackRows(trajectory.stamps_ns, np.column_stack([trajectory.positions_m, rpy]))


def in_truth_frame(points_m: FloatArray, estimate: Trajectory, truth: Trajectory) -> FloatArray:
    """Return points (N, 3) moved so that the first pose of `estimate` has the true position and heading."""
    first, true = rows_of(estimate).poses[0], rows_of(truth).poses[0]
    turn = true[5] - first[5]
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    moved: FloatArray = (points_m - first[:3]) @ R.T + true[:3]
    return moved


def distances_to_mesh(points_m: FloatArray, mesh_file: Path) -> FloatArray:
    """Return the distance (N,) of each point to the mesh."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.io.read_triangle_mesh(str(mesh_file)))
    found: FloatArray = scene.compute_distance(o3d.core.Tensor(points_m.astype(np.float32))).numpy().astype(float)  # type: ignore[call-overload]
    return found
