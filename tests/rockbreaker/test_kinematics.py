"""Kinematics against the figures of the issue, finite differences, and brute force."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.errors import ConfigError, InputError
from lhdmap.rockbreaker import cylinders, kinematics
from lhdmap.rockbreaker.machine import Rockbreaker, load_rockbreaker, rockbreaker_toml
from lhdmap.rockbreaker.orientation import candidates, nearest_vertical, phi_intervals, phi_range, planar_position
from lhdmap.rockbreaker.reach import workspace_json

from tests.rockbreaker.poses import FL, NL, random_poses

MACHINE = Rockbreaker()
SHARES = st.lists(st.floats(0.001, 0.999), min_size=4, max_size=4)


def test_joint_limits_follow_from_the_cylinders() -> None:
    wanted = [[-73.232, -25.819, -144.445, -82.365], [73.232, 80.077, -43.562, 41.171]]
    assert np.degrees(MACHINE.theta_limits) == pytest.approx(np.array(wanted), abs=1e-3)


def test_the_swing_rate_limit_is_the_lowest_point_of_fig_6() -> None:
    assert math.degrees(MACHINE.swing_rate_limit) == pytest.approx(6.035, abs=1e-3)


@pytest.mark.parametrize(
    ("pose", "theta_deg", "rho_m"),
    [
        (NL, (44.3415, 59.8824, -126.6778, -18.0045), (1.13423, 1.44001, 2.49193, 2.50731, 2.08847)),
        (FL, (18.9270, 21.5106, -45.5601, -37.1505), (1.22279, 1.36401, 2.07529, 1.56044, 2.29122)),
    ],
)
def test_inverse_kinematics_of_the_corners(
    pose: np.ndarray, theta_deg: tuple[float, ...], rho_m: tuple[float, ...]
) -> None:
    theta = kinematics.theta_of_pose(MACHINE, pose)
    assert np.degrees(theta) == pytest.approx(np.array(theta_deg), abs=6e-5)
    assert cylinders.rho_of_theta(MACHINE, theta) == pytest.approx(np.array(rho_m), abs=6e-6)


@given(SHARES)
def test_round_trips(shares: list[float]) -> None:
    low, high = MACHINE.theta_limits
    theta = low + np.array(shares) * (high - low)
    rho = cylinders.rho_of_theta(MACHINE, theta)
    assert np.abs(cylinders.theta_of_rho(MACHINE, rho) - theta).max() <= 1e-9
    pose = kinematics.pose_of_theta(MACHINE, theta)
    if abs(math.atan2(pose[1], pose[0]) - theta[0]) < 1e-6:  # else the arm reaches back over its post
        back = kinematics.theta_of_pose(MACHINE, pose)
        assert np.abs(back - theta).max() <= 1e-9
        assert np.abs(kinematics.pose_of_theta(MACHINE, back)[:3] - pose[:3]).max() <= 1e-9


@given(SHARES)
def test_both_swing_cylinders_give_the_same_angle(shares: list[float]) -> None:
    low, high = MACHINE.theta_limits
    theta = low + np.array(shares) * (high - low)
    mirrored = theta * np.array([-1.0, 1.0, 1.0, 1.0])
    assert cylinders.rho_of_theta(MACHINE, theta)[0] == pytest.approx(
        cylinders.rho_of_theta(MACHINE, mirrored)[1], abs=1e-12
    )


def _differences(function, at: np.ndarray, step: float = 1e-6) -> np.ndarray:  # type: ignore[no-untyped-def]
    columns = [
        (function(at + step * unit) - function(at - step * unit)) / (2.0 * step) for unit in np.eye(at.shape[-1])
    ]
    return np.stack(columns, axis=-1)


@given(SHARES)
def test_jacobians_are_the_derivatives(shares: list[float]) -> None:
    low, high = MACHINE.theta_limits
    theta = low + np.array(shares) * (high - low)

    def pose(angles: np.ndarray) -> np.ndarray:
        found = kinematics.pose_of_theta(MACHINE, angles)
        return np.append(found[:3], angles[1:].sum())

    def rho(angles: np.ndarray) -> np.ndarray:
        return cylinders.rho_of_theta(MACHINE, angles)

    assert np.abs(kinematics.jacobian_theta(MACHINE, theta) - _differences(pose, theta)).max() <= 1e-6
    assert np.abs(kinematics.jacobian_rho(MACHINE, theta) - _differences(rho, theta)).max() <= 1e-6


def test_the_jacobian_from_pose_to_cylinders_is_the_derivative() -> None:
    for pose in random_poses(MACHINE, 40, seed=4):
        theta = kinematics.theta_of_pose(MACHINE, pose)
        if math.hypot(pose[0], pose[1]) < 0.5:
            continue

        def rho(at: np.ndarray) -> np.ndarray:
            return cylinders.rho_of_theta(MACHINE, kinematics.theta_of_pose(MACHINE, at))

        assert np.abs(kinematics.jacobian_pose(MACHINE, theta) - _differences(rho, pose)).max() <= 1e-6


def test_planar_rates_are_the_inverse_of_the_jacobian() -> None:
    rng = np.random.default_rng(0)
    poses = random_poses(MACHINE, 50, seed=5)
    theta = kinematics.theta_of_pose(MACHINE, poses)
    rates = rng.normal(size=(50, 3))
    flat = theta * np.array([0.0, 1.0, 1.0, 1.0])
    forward = kinematics.jacobian_theta(MACHINE, flat)[:, [0, 2, 3], 1:]
    found = kinematics.planar_rates(MACHINE, theta, rates)
    assert np.abs(np.einsum("nij,nj->ni", forward, found) - rates).max() < 1e-9


def test_phi_ranges_of_the_corners() -> None:
    for pose, wanted in ((NL, (227.290, 286.422)), (FL, (292.719, 331.542))):
        low, high = phi_range(MACHINE, planar_position(pose[:3]))
        assert (math.degrees(low), math.degrees(high)) == pytest.approx(wanted, abs=1e-3)


def _swept(point: np.ndarray, step_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return orientations and whether each is feasible, by trying them."""
    phi = np.radians(np.arange(90.0 + step_deg, 450.0, step_deg))
    poses = np.column_stack([np.tile(point, (len(phi), 1)), phi])
    return phi, kinematics.within(MACHINE, kinematics.theta_of_pose(MACHINE, poses))


def test_intervals_are_those_of_a_sweep() -> None:
    """A sweep may miss an interval that is narrower than its step."""
    step_deg = 0.05
    for pose in random_poses(MACHINE, 150, seed=6):
        phi, feasible = _swept(pose[:3], step_deg)
        found = phi_intervals(MACHINE, planar_position(pose[:3]))
        found = found[~np.isnan(found[:, 0])]
        inside = np.any((phi[:, None] >= found[:, 0]) & (phi[:, None] <= found[:, 1]), axis=1)
        near_end = np.min(np.abs(phi[:, None] - found.ravel()), axis=1) < math.radians(step_deg)
        assert np.all((inside == feasible) | near_end)
        low, high = phi_range(MACHINE, planar_position(pose[:3]))
        assert (low, high) == pytest.approx((found.min(), found.max()), abs=1e-12)


def test_each_candidate_reaches_the_tip_with_a_joint_at_a_limit() -> None:
    poses = random_poses(MACHINE, 60, seed=7)
    phi, theta = candidates(MACHINE, planar_position(poses[:, :3]))
    assert phi.shape == (60, 12)
    kept = ~np.isnan(phi)
    assert kept.any(axis=1).all()
    angles = np.concatenate([np.zeros((60, 12, 1)), theta], axis=-1)[kept]
    reached = kinematics.pose_of_theta(MACHINE, angles)
    wanted = np.repeat(planar_position(poses[:, :3])[:, None], 12, axis=1)[kept]
    assert np.abs(reached[:, [0, 2]] - wanted).max() < 1e-9
    distance = np.min(np.abs(angles[:, None, 1:] - MACHINE.theta_limits[None, :, 1:]), axis=(1, 2))
    assert distance.max() < 1e-9


def test_orientation_is_vertical_where_that_is_possible_and_else_nearest() -> None:
    assert math.degrees(nearest_vertical(MACHINE, NL[:3])) == 270.0
    assert math.degrees(nearest_vertical(MACHINE, FL[:3])) == pytest.approx(292.719, abs=1e-3)
    assert math.isnan(nearest_vertical(MACHINE, np.array([9.0, 0.0, 0.0])))
    assert math.isnan(nearest_vertical(MACHINE, np.array([-3.0, 1.0, -1.0])))


def test_a_machine_file_says_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(rockbreaker_toml(MACHINE), encoding="utf-8")
    assert load_rockbreaker(path) == MACHINE


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[joint.elbow]\nlink_m = 1.0", "elbow"),
        ("[joint.breaker]\nlinks_m = 1.0", "did you mean 'link_m'"),
        ("[joint.breaker]\nlongest_m = 9.0", "pins"),
        ("[joint.breaker]\nshortest_m = 2.65", "joint.breaker"),
        ("[grizly]\n", "did you mean 'grizzly'"),
        ("[base]\npump_flow_lpm = -1.0", "pump_flow_lpm"),
        ("[base]\nyaw_deg = inf", "yaw_deg"),
        ("base = 3", r"a section \[base\]"),
        ("joint = 3", r"a section \[joint\]"),
        ("[joint]\nswing = 3", r"a section \[joint\.swing\]"),
        ("[grizzly]\nmin_m = [7.0, -1.0]", "grizzly"),
    ],
)
def test_a_wrong_machine_file_is_refused(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=told):
        load_rockbreaker(path)


def _with_offsets(offset_deg: dict[int, float]) -> Rockbreaker:
    """Return Table 1 with other offsets ε of some joints."""
    joints = [replace(one, offset_deg=offset_deg.get(k, one.offset_deg)) for k, one in enumerate(MACHINE.joints)]
    return Rockbreaker(joints=tuple(joints))


def test_offsets_in_another_turn_describe_the_same_machine() -> None:
    turned = _with_offsets({0: 270.96, 1: 302.37, 2: 352.4, 3: -299.44})
    assert turned.theta_limits == pytest.approx(MACHINE.theta_limits, abs=1e-9)
    for pose in random_poses(MACHINE, 20, seed=8):
        assert kinematics.theta_of_pose(turned, pose) == pytest.approx(
            kinematics.theta_of_pose(MACHINE, pose), abs=1e-9
        )
        assert nearest_vertical(turned, pose[:3]) == pytest.approx(nearest_vertical(MACHINE, pose[:3]), abs=1e-9)


@pytest.mark.parametrize(("offset_deg", "inside_deg"), [(40.0, (-96.845, -1.0)), (-60.0, (-179.0, -95.962))])
def test_an_outer_boom_that_could_pass_in_line_is_kept_from_it(
    offset_deg: float, inside_deg: tuple[float, float]
) -> None:
    machine = _with_offsets({2: offset_deg})
    assert np.degrees(machine.theta_limits[:, 2]) == pytest.approx(inside_deg, abs=1e-3)
    for pose in random_poses(machine, 100, seed=9):
        assert kinematics.within(machine, kinematics.theta_of_pose(machine, pose)).all()


def test_orientations_of_an_arm_that_points_up_do_not_wrap() -> None:
    """With θ3 of 33 to 134 deg the range of φ goes through 90 deg; swept in steps, by both elbows' one solution."""
    machine = _with_offsets({2: 170.0})
    step = math.radians(0.1)
    for pose in random_poses(machine, 40, seed=10):
        phi = pose[3] + np.arange(-math.pi, math.pi, step)
        swept = np.column_stack([np.tile(pose[:3], (len(phi), 1)), phi])
        feasible = kinematics.within(machine, kinematics.theta_of_pose(machine, swept))
        found = phi_intervals(machine, planar_position(pose[:3]))
        length = float(np.nansum(found[:, 1] - found[:, 0]))
        assert length == pytest.approx(feasible.sum() * step, abs=3 * step)
        off = np.abs(np.angle(np.exp(1j * (phi[feasible] - math.radians(270.0)))))
        away = abs(math.remainder(nearest_vertical(machine, pose[:3]) - math.radians(270.0), 2.0 * math.pi))
        assert away == pytest.approx(off.min(), abs=2 * step)


def test_the_slice_of_a_machine_that_hardly_moves_is_empty() -> None:
    stiff = Rockbreaker(
        joints=(MACHINE.joints[0], *(replace(one, shortest_m=2.0, longest_m=2.001) for one in MACHINE.joints[1:]))
    )
    values = workspace_json(stiff, None)
    assert (values["area_m2"], values["x_m"], values["z_m"]) == (0.0, None, None)


def test_a_missing_machine_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml"):
        load_rockbreaker(tmp_path / "none.toml")
