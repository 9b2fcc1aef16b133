"""Upright frames, grown boxes, and the rear axle, against matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se3
from lhdmap.geometry.articulated import T_base_rear, T_rear_base, rear_axle
from lhdmap.geometry.boxes import grown
from lhdmap.geometry.frame import UprightFrame

FRAME = UprightFrame(np.array([3.0, -2.0, 0.5]), 0.7)


def test_a_frame_is_the_matrix_of_its_yaw() -> None:
    points = np.random.default_rng(1).normal(size=(3, 5, 3))
    T_map_frame = se3.from_rpy(0.0, 0.0, FRAME.heading_rad, (3.0, -2.0, 0.5))
    np.testing.assert_allclose(FRAME.map(points), points @ T_map_frame[:3, :3].T + T_map_frame[:3, 3], atol=1e-12)
    np.testing.assert_allclose(FRAME.local(FRAME.map(points)), points, atol=1e-12)


def test_a_turned_frame_begins_at_its_point() -> None:
    turned = FRAME.turned(np.array([1.0, 2.0, 0.0]), 0.5 * math.pi)
    np.testing.assert_allclose(FRAME.local(turned.map(np.array([1.0, 0.0, 0.0]))), [1.0, 3.0, 0.0], atol=1e-12)


def test_the_rear_axle_is_where_the_matrices_say() -> None:
    x, y, heading, bend, front_m, rear_m = 2.0, 1.0, 0.4, -0.5, 1.6, 1.7
    T_map_base = se3.from_rpy(0.0, 0.0, heading, (x, y, 0.0))
    T_map_rear = T_map_base @ T_base_rear(bend, front_m, rear_m)
    assert rear_axle(x, y, heading, bend, front_m, rear_m) == pytest.approx(
        (T_map_rear[0, 3], T_map_rear[1, 3], se3.to_rpy(T_map_rear)[2])
    )
    np.testing.assert_allclose(
        T_base_rear(bend, front_m, rear_m) @ T_rear_base(bend, front_m, rear_m), np.eye(4), atol=1e-12
    )


def test_boxes_grow_on_all_sides_and_the_given_ones_stay() -> None:
    boxes = np.array([[[-1.0, -2.0, 0.0], [1.0, 2.0, 3.0]]])
    assert grown(boxes, 0.5).tolist() == [[-1.5, -2.5, -0.5, 1.5, 2.5, 3.5]]
    assert boxes[0, 0].tolist() == [-1.0, -2.0, 0.0]
