"""The articulated machine against its definition: neither axle may slip sideways."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.geometry import se3
from lhdmap.kinematics import T_base_rear, articulation_along_path, articulation_for_curvature, heading_rate
from lhdmap.machine import Dimensions, Machine
from lhdmap.messages import FloatArray

UNEVEN = Machine(dimensions=Dimensions(joint_to_front_axle_m=1.4, joint_to_rear_axle_m=2.1))


def rear_axle(pose: FloatArray, articulation_rad: float, machine: Machine) -> FloatArray:
    """Rear axle's middle and heading from geometry alone: along the front body to the joint, then along the rear."""
    front_m, rear_m = machine.dimensions.joint_to_front_axle_m, machine.dimensions.joint_to_rear_axle_m
    rear_heading = pose[2] - articulation_rad
    joint = pose[:2] - front_m * np.array([math.cos(pose[2]), math.sin(pose[2])])
    return np.append(joint - rear_m * np.array([math.cos(rear_heading), math.sin(rear_heading)]), rear_heading)


@pytest.mark.parametrize("articulation_rad", [-0.6, -0.2, 0.0, 0.3, 0.6])
@pytest.mark.parametrize("articulation_rate_rps", [-0.2, 0.0, 0.15])
@pytest.mark.parametrize("speed_mps", [-2.0, 3.0])
def test_rear_axle_does_not_slip_sideways(
    articulation_rad: float, articulation_rate_rps: float, speed_mps: float
) -> None:
    def place(t: float) -> FloatArray:
        rate = heading_rate(speed_mps, articulation_rad, articulation_rate_rps, UNEVEN)
        pose = np.array([speed_mps * t, 0.5 * speed_mps * rate * t * t, rate * t])
        return rear_axle(pose, articulation_rad + articulation_rate_rps * t, UNEVEN)

    step = 1e-5
    velocity = (place(step) - place(-step)) / (2 * step)
    heading = place(0.0)[2]
    lateral = -math.sin(heading) * velocity[0] + math.cos(heading) * velocity[1]
    assert lateral == pytest.approx(0.0, abs=1e-8)


def test_bending_left_turns_left_forwards_and_right_in_reverse() -> None:
    assert heading_rate(2.0, 0.3, 0.0, Machine()) > 0.1
    assert heading_rate(-2.0, 0.3, 0.0, Machine()) < -0.1
    assert heading_rate(2.0, -0.3, 0.0, Machine()) < -0.1


def test_bending_at_rest_turns_the_front_by_its_share() -> None:
    assert heading_rate(0.0, 0.0, 0.2, UNEVEN) == pytest.approx(0.2 * 2.1 / 3.5)


@given(radius_m=st.floats(4.5, 500.0), sign=st.sampled_from([-1.0, 1.0]))
def test_steady_articulation_drives_the_arc(radius_m: float, sign: float) -> None:
    bend = articulation_for_curvature(sign / radius_m, UNEVEN)
    assert heading_rate(1.0, bend, 0.0, UNEVEN) == pytest.approx(sign / radius_m, rel=1e-9)


def test_too_tight_an_arc_is_refused() -> None:
    with pytest.raises(ValueError, match="tighter"):
        articulation_for_curvature(1.0, UNEVEN)


@given(bend=st.floats(-0.9, 0.9))
def test_rear_pose_agrees_with_the_geometry(bend: float) -> None:
    T = T_base_rear(bend, UNEVEN)
    expected = rear_axle(np.zeros(3), bend, UNEVEN)
    assert T[:2, 3] == pytest.approx(expected[:2], abs=1e-12)
    assert se3.to_rpy(T)[2] == pytest.approx(expected[2], abs=1e-12)


def test_articulation_along_a_path_settles_on_the_arc() -> None:
    curvature = np.concatenate([np.zeros(500), np.full(4000, 1 / 9.0)])
    bend = articulation_along_path(curvature, 0.01, 1.4, 2.1)
    assert bend[499] == pytest.approx(0.0, abs=1e-12)
    assert bend[-1] == pytest.approx(articulation_for_curvature(1 / 9.0, UNEVEN), abs=1e-6)
    rate = np.array(
        [heading_rate(1.0, float(g), float(r), UNEVEN) for g, r in zip(bend, np.gradient(bend, 0.01), strict=True)]
    )
    assert np.abs(rate - curvature)[10:490].max() < 1e-9
    assert np.abs(rate - curvature)[510:].max() < 1e-4
