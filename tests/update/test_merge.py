"""Two drives as one map: trajectories, clouds, views."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.integration.cloud import GridCloud
from lhdmap.smoothing.smoother import Correction
from lhdmap.topology.views import Fan, View
from lhdmap.trajectory import Trajectory
from lhdmap.update.merge import joined_clouds, moved_cloud, moved_trajectory, poses_of, trajectory_of, view_poses

STAMPS = np.array([0, 10, 20], dtype=np.int64)
POSES = np.array([[0.0, 0.0, 0.0, 0.01, -0.05, 3.0], [1.0, 0.2, 0.1, 0.0, 0.02, 3.2], [2.0, 0.0, 0.2, 0.0, 0.0, 3.4]])
TURN = Correction(np.array([0, 20], np.int64), np.array([[5.0, -2.0, math.pi / 2]] * 2), 2, None, np.array([1.0, 1.0]))


def test_poses_go_to_a_trajectory_and_back() -> None:
    assert poses_of(trajectory_of(STAMPS, POSES)) == pytest.approx(POSES, abs=1e-9)


def test_a_trajectory_moves_rigidly_where_the_correction_is_one_motion() -> None:
    moved = poses_of(moved_trajectory(trajectory_of(STAMPS, POSES), TURN))
    assert moved[:, 0] == pytest.approx(5.0 - POSES[:, 1])
    assert moved[:, 1] == pytest.approx(-2.0 + POSES[:, 0])
    assert moved[:, 2] == pytest.approx(POSES[:, 2] + 1.0)
    assert moved[:, 3:5] == pytest.approx(POSES[:, 3:5], abs=1e-9)
    assert np.cos(moved[:, 5] - POSES[:, 5] - math.pi / 2) == pytest.approx(1.0)


def test_a_cloud_moves_with_its_normals() -> None:
    cloud = GridCloud(
        np.array([[1.0, 0.0, 2.0]], np.float32), np.array([[1.0, 0.0, 0.0]], np.float32), stamps_ns=STAMPS[1:2]
    )
    moved = moved_cloud(cloud, TURN)
    assert moved.points_m[0] == pytest.approx([5.0, -1.0, 3.0])
    assert moved.normals is not None
    assert moved.normals[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)


def test_walls_that_went_leave_the_cloud_and_new_points_come_in() -> None:
    path = np.column_stack([np.linspace(0.0, 20.0, 41), np.zeros((41, 3))])
    wall = np.array([[10.0, y, z] for y in np.linspace(-2.0, 2.0, 21) for z in np.linspace(0.5, 2.5, 5)], np.float32)
    side = np.array([[x, 2.5, 1.0] for x in np.linspace(0.0, 20.0, 81)], np.float32)
    floor = np.array([[10.0, y, 0.02] for y in np.linspace(-2.0, 2.0, 21)], np.float32)
    known, drive = (
        GridCloud(np.vstack([wall, side, floor])),
        GridCloud(np.vstack([side + 0.001, [[19.0, -2.5, 1.0]]]).astype(np.float32)),
    )
    joined = joined_clouds(known, drive, wall[::5, :2].astype(float), path).points_m
    across = (np.abs(joined[:, 0] - 10.0) < 0.05) & (np.abs(joined[:, 1]) < 2.2)
    assert joined[across][:, 2].max() < 0.1  # the floor stays
    assert across.sum() == len(floor)
    assert len(joined) <= len(side) + len(floor) + len(side) // 4 + 1  # what is there already does not come twice
    assert (np.abs(joined - [19.0, -2.5, 1.0]).max(axis=1) < 1e-6).any()


def test_views_are_where_the_machine_was_between_two_poses() -> None:
    views = [View(5, 0.5, (Fan(np.zeros(2), np.zeros((1, 3), np.float32)),)), View(20, 2.0, ())]
    trajectory = Trajectory(STAMPS, POSES[:, :3], trajectory_of(STAMPS, POSES).quaternions_xyzw)
    found = view_poses(trajectory, views)
    assert found[0] == pytest.approx([0.5, 0.1, 0.05, 3.1], abs=1e-6)
    assert found[1] == pytest.approx(POSES[2, [0, 1, 2, 5]], abs=1e-6)
