"""Odometry of 3D scanners on simulated drifts with known truth, on a real pair of scans, and on bad input."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from lhdmap.geometry import se3
from lhdmap.geometry.twist import exp, log
from lhdmap.messages import Float32Array, FloatArray, PointCloud
from lhdmap.odometry.cloud.motion import CloudPrior
from lhdmap.odometry.cloud.odometry import CloudOdometry
from lhdmap.odometry.cloud.settings import CloudOdometrySettings
from lhdmap.odometry.cloud.steps import CloudStep, marginal_information
from lhdmap.odometry.cloud.sweep import CloudSweep, sweep_of
from lhdmap.simulation.sections import DriftSettings

from tests.odometry.cloud_drives import (
    NO_TIMES,
    T_BASE_SENSOR,
    CloudDrive,
    drift_world,
    errors,
    run,
    simulate,
    step_errors,
    wheels_of,
)

STRAIGHT = ((500.0, 0.0, 0.0),)
BENDS = ((18.0, 0.0, -6.0), (8.0, 10.0, 0.0), (30.0, -14.0, 6.0))
IDENTITY = np.eye(4)


@pytest.fixture(scope="module")
def rough() -> CloudDrive:
    """21 m through a rough drift with bends and grades, at 12 km/h, from rest."""
    world = drift_world(3, DriftSettings(pieces=BENDS, mesh_m=0.12), 12.0)
    return simulate(world, 30.0, count=94)


@pytest.fixture(scope="module")
def rough_steps(rough: CloudDrive) -> list[CloudStep]:
    return run(CloudOdometry(), rough)


@pytest.fixture(scope="module")
def smooth() -> CloudDrive:
    """A straight, level, smooth drift whose ends are out of sight, already moving at the first cloud."""
    drift = DriftSettings(pieces=STRAIGHT, mesh_m=0.12, roughness_m=0.005, floor_undulation_m=0.0)
    drive = simulate(drift_world(2, drift, 12.0), 12.0, count=60)
    return drive.part(range(20, 60))


def _end_percent(steps: list[CloudStep], drive: CloudDrive) -> float:
    return 100.0 * float(np.linalg.norm(errors(steps, drive)[-1, :3, 3])) / drive.way_m


def test_end_error_in_a_rough_drift(rough: CloudDrive, rough_steps: list[CloudStep]) -> None:
    assert rough.way_m > 20.0
    assert _end_percent(rough_steps, rough) < 0.4
    assert np.abs(np.degrees(se3.to_rpy(errors(rough_steps, rough)[-1]))).max() < 0.3
    assert not any(step.lost or step.degenerate for step in rough_steps)
    assert [step.stamp_ns for step in rough_steps] == [cloud.stamp_ns for cloud in rough.clouds]


def test_information_is_that_of_the_errors(rough: CloudDrive, rough_steps: list[CloudStep]) -> None:
    """Two poses make a step, so its error has twice the variance of a pose; sweeps add some to the step, not to poses."""
    seen = step_errors(rough_steps, rough)[20:, :2, 3]
    stated = np.array([step.information[:2] for step in rough_steps[21:] if step.processed]) ** -0.5
    ratio = np.sqrt(np.mean(seen**2, axis=0) / 2.0) / np.median(stated, axis=0)
    assert (ratio > 0.4).all()
    assert (ratio < 2.0).all()


def test_covariance_is_proper(rough_steps: list[CloudStep]) -> None:
    for step in rough_steps:
        assert step.covariance.shape == (6, 6)
        assert np.linalg.eigvalsh(step.covariance).min() > 0.0
        assert np.isfinite(step.velocity).all()


def test_velocity_of_the_machine(rough_steps: list[CloudStep]) -> None:
    assert np.mean([step.velocity[0] for step in rough_steps[-20:]]) == pytest.approx(12.0 / 3.6, rel=0.05)


def test_starts_level_and_keeps_to_gravity(rough: CloudDrive, rough_steps: list[CloudStep]) -> None:
    for index in (0, -1):
        wanted, got = se3.to_rpy(rough.T_map_base[index]), se3.to_rpy(rough_steps[index].T_odom_base)
        np.testing.assert_allclose(np.degrees(got[:2]), np.degrees(wanted[:2]), atol=0.3)
    assert se3.to_rpy(rough_steps[0].T_odom_base)[2] == 0.0


def test_same_to_the_bit(rough: CloudDrive, rough_steps: list[CloudStep]) -> None:
    again = run(CloudOdometry(), rough.part(range(12)))
    for step, before in zip(again, rough_steps, strict=False):
        np.testing.assert_array_equal(step.T_odom_base, before.T_odom_base)


def test_kiss_icp_runs(rough: CloudDrive) -> None:
    part = rough.part(range(24))
    steps = run(CloudOdometry(CloudOdometrySettings(method="kiss_icp")), part)
    poses = np.array([step.T_odom_base for step in steps])
    assert np.isfinite(poses).all()
    np.testing.assert_allclose(
        poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.broadcast_to(np.eye(3), (24, 3, 3)), atol=1e-9
    )
    assert poses[-1, 0, 3] > 0.3  # it moves, if not as far as the machine


def test_smooth_drift_is_flagged_and_wheels_stand_in(smooth: CloudDrive) -> None:
    steps = run(CloudOdometry(), smooth, wheels_of(smooth, 1.005))
    assert _end_percent(steps, smooth) < 1.0
    later = [step for step in steps[10:] if step.processed]
    assert np.mean([step.degenerate for step in later]) > 0.9
    assert {step.substitute for step in later if step.degenerate} == {"wheels"}
    across_m = np.array([step.information[1] for step in later]) ** -0.5
    along_m = np.array([step.information[0] for step in later]) ** -0.5
    assert np.median(along_m) > 10.0 * np.median(across_m)


def test_smooth_drift_without_wheels_is_flagged(smooth: CloudDrive) -> None:
    steps = run(CloudOdometry(), smooth.part(range(20)))
    later = [step for step in steps[10:] if step.processed]
    assert {(step.degenerate, step.substitute) for step in later} == {(True, "motion")}


def test_slipping_wheels_are_left_out(rough: CloudDrive) -> None:
    part = rough.part(range(30, 60))
    good, slipping = wheels_of(part, 1.0), wheels_of(part, 1.6)
    steps = run(CloudOdometry(), part, good[:15] + slipping[15:])
    assert _end_percent(steps, part) < 0.5


def test_start_in_motion(rough: CloudDrive) -> None:
    """The first cloud is undone with a velocity that is known only later, and its stamp keeps its pose."""
    part = rough.part(range(50, 75))
    assert _end_percent(run(CloudOdometry(), part), part) < 0.8


def test_jump_is_flagged_once(rough: CloudDrive) -> None:
    """Clouds of 1.5 s are missing, but the stamps go on as if nothing were: faster than any machine."""
    part = rough.part(range(35, 55), range(70, 80))
    renumbered = [cloud._replace(stamp_ns=part.clouds[0].stamp_ns + k * 10**8) for k, cloud in enumerate(part.clouds)]
    steps = run(CloudOdometry(), CloudDrive(renumbered, part.T_map_base))
    assert [k for k, step in enumerate(steps) if step.lost] == [20]
    assert float(np.linalg.norm(errors(steps, part)[-1, :3, 3])) < 0.15
    assert abs(float(steps[-1].velocity[0]) - 12.0 / 3.6) < 0.3


def test_blackout_is_bridged(rough: CloudDrive) -> None:
    part = rough.part(range(30, 60))
    empty = np.zeros((0, 3), dtype=np.float32)
    dark = [
        cloud._replace(points_m=empty, time_offsets_s=NO_TIMES) if 15 <= k < 25 else cloud
        for k, cloud in enumerate(part.clouds)
    ]
    steps = run(CloudOdometry(), CloudDrive(dark, part.T_map_base))
    assert [k for k, step in enumerate(steps) if step.lost] == list(range(15, 25))
    assert all(step.support == 0.0 and not step.information.any() for step in steps[15:25])
    assert _end_percent(steps, part) < 1.0


def test_another_place_begins_a_new_map(rough: CloudDrive) -> None:
    stage = CloudOdometry()
    run(stage, rough.part(range(5)))
    rng = np.random.default_rng(0)
    room = _room(rng)
    base_ns = rough.clouds[5].stamp_ns
    steps = [stage.update(PointCloud(base_ns + k * 10**8, "l", room, NO_TIMES), T_BASE_SENSOR) for k in range(20)]
    assert steps[0].lost
    assert not steps[-1].lost
    assert [step.support for step in steps if step.processed][-1] > 0.8


def _room(rng: np.random.Generator) -> Float32Array:
    """Return points on the walls and the floor of a hall, shape (6000, 3)."""
    points = rng.uniform((-20.2, -15.3, -2.2), (20.2, 15.3, 8.0), (6000, 3))
    side = rng.integers(0, 5, 6000)
    for k, (axis, value) in enumerate([(0, -20.2), (0, 20.2), (1, -15.3), (1, 15.3), (2, -2.2)]):
        points[side == k, axis] = value
    return points.astype(np.float32)


def test_map_is_bounded(rough: CloudDrive) -> None:
    near = [
        cloud._replace(points_m=cloud.points_m[kept], time_offsets_s=cloud.time_offsets_s[kept])
        for cloud in rough.clouds[::2]
        for kept in [np.linalg.norm(cloud.points_m, axis=1) < 6.0]
    ]
    drive = CloudDrive(near, rough.T_map_base[::2])
    sizes = []
    for window_m in (4.0, 500.0):
        stage = CloudOdometry(CloudOdometrySettings(window_m=window_m, insert_m=0.4))
        run(stage, drive)
        sizes.append(stage.map_size)
    assert sizes[0] < 0.7 * sizes[1]


def test_standing_still_is_not_processed_each_time() -> None:
    stage = CloudOdometry()
    rng = np.random.default_rng(1)
    room = _room(rng)
    steps = []
    for k in range(40):
        noisy = (room + 0.01 * rng.standard_normal(room.shape)).astype(np.float32)
        steps.append(stage.update(PointCloud(10**18 + k * 10**8, "l", noisy, NO_TIMES), IDENTITY))
    skipped = [step for step in steps if not step.processed]
    assert len(skipped) > 15
    assert not any(step.lost or step.degenerate for step in steps)
    assert max(float(np.linalg.norm(step.T_odom_base[:3, 3])) for step in steps) < 0.005


@pytest.mark.shared
@pytest.mark.parametrize("method", ["vgicp", "kiss_icp"])
def test_real_pair(shared_data: Path, method: str) -> None:
    """A real outdoor pair 0.5 m apart; GICP, VGICP and kiss-icp all differ from its truth by 0.2-0.6 degrees."""
    folder = shared_data / "12_registration_pair"
    truth = np.loadtxt(folder / "T_target_source.txt")
    stage = CloudOdometry(CloudOdometrySettings(method=method))
    stage.update(PointCloud(10**18, "l", _ply_points(folder / "target.ply"), NO_TIMES), IDENTITY)
    step = stage.update(PointCloud(10**18 + 10**8, "l", _ply_points(folder / "source.ply"), NO_TIMES), IDENTITY)
    error = se3.inverse(truth) @ step.T_odom_base
    assert float(np.linalg.norm(error[:3, 3])) < 0.03
    assert np.degrees(np.abs(se3.to_rpy(error))).max() < 0.3
    assert not step.lost
    assert not step.degenerate


def _ply_points(path: Path) -> Float32Array:
    """Return x y z, shape (N, 3), of a binary PLY of four floats a vertex."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    count = int(head.split(b"element vertex ")[1].split()[0])
    return np.frombuffer(body, dtype="<f4", count=4 * count).reshape(-1, 4)[:, :3].copy()


BAD_CLOUDS = {
    "empty": np.zeros((0, 3)),
    "nan": np.full((500, 3), np.nan),
    "infinite": np.full((500, 3), np.inf),
    "huge": np.full((500, 3), 1e30),
    "one place": np.ones((500, 3)),
    "a line": np.linspace(1.0, 50.0, 2000)[:, None] * np.ones((1, 3)),
    "a plane": np.random.default_rng(2).uniform(-20, 20, (3000, 3)) * [1.0, 1.0, 0.0],
    "three points": np.eye(3) * 5.0,
    "chaos": np.random.default_rng(3).uniform(-50.0, 50.0, (2000, 3)),
}


@pytest.mark.parametrize("method", ["vgicp", "kiss_icp"])
@pytest.mark.parametrize("first", [True, False], ids=["at the start", "later"])
def test_bad_clouds(method: str, first: bool) -> None:
    """Bad clouds, priors, times and backward stamps: poses stay finite, and good clouds are taken afterwards."""
    room = _room(np.random.default_rng(4))
    stage = CloudOdometry(CloudOdometrySettings(method=method))
    clouds = [*BAD_CLOUDS.values()] if first else [room, *BAD_CLOUDS.values()]
    bad_prior = CloudPrior(np.full((4, 4), np.nan), np.full((3, 3), np.nan))
    for k, points in enumerate([*clouds, *[room] * 15]):
        stamp_ns = 10**18 + (k if k % 3 else k - 2) * 10**8
        times = np.full(len(points), np.nan if k % 2 else 0.01, dtype=np.float32)
        cloud = PointCloud(stamp_ns, "l", points.astype(np.float32), times if k % 4 else NO_TIMES)
        step = stage.update(cloud, IDENTITY, bad_prior)
        assert np.isfinite(step.T_odom_base).all()
        assert np.isfinite(step.covariance).all()
        np.testing.assert_allclose(np.linalg.det(step.T_odom_base[:3, :3]), 1.0, atol=1e-9)
    steps = [stage.update(PointCloud(10**18 + (k + 60) * 10**8, "l", room, NO_TIMES), IDENTITY) for k in range(4)]
    assert not steps[-1].lost


def test_own_body_and_range_limits_are_left_out() -> None:
    points = np.array([[1.0, 0.0, 0.0], [10.0, 0.0, 0.0], [90.0, 0.0, 0.0], [0.1, 0.0, 0.0], [np.nan, 1.0, 1.0]])
    cloud = PointCloud(0, "l", points.astype(np.float32), np.arange(5, dtype=np.float32) * 0.01)
    mount = se3.from_rpy(0.0, 0.0, math.pi / 2, (0.0, 0.0, 1.0))
    body = np.array([[-1.0, -2.0, 0.0, 1.0, 2.0, 2.0]])
    sweep = sweep_of(cloud, mount, (0.5, 60.0), body)
    np.testing.assert_allclose(sweep.points_m, [[0.0, 10.0, 1.0]], atol=1e-6)
    np.testing.assert_allclose(sweep.times_s, [0.01 - 0.02], atol=1e-6)


TWISTS = hnp.arrays(np.float64, 6, elements=st.floats(-1.2, 1.2))


@given(TWISTS)
def test_log_undoes_exp(twist: FloatArray) -> None:
    T = exp(twist)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(log(T), twist, atol=1e-9)


def test_log_of_half_a_turn() -> None:
    np.testing.assert_allclose(np.abs(log(se3.from_rpy(0.0, 0.0, math.pi))), [0, 0, math.pi, 0, 0, 0], atol=1e-6)


@given(TWISTS.map(lambda twist: twist * [0.4, 0.4, 0.4, 6.0, 6.0, 6.0]), st.floats(-0.06, 0.06))
def test_sweep_is_undone_by_the_motion(twist: FloatArray, time_s: float) -> None:
    points = np.array([[20.0, 5.0, 1.0], [-3.0, 10.0, 2.0], [0.0, 0.0, 0.0]])
    undone = CloudSweep(points, np.full(3, time_s)).undone(twist)
    T = exp(time_s * twist)
    np.testing.assert_allclose(undone, points @ T[:3, :3].T + T[:3, 3], atol=1.5e-3)


@settings(max_examples=50)
@given(hnp.arrays(np.float64, (8, 6), elements=st.floats(-3.0, 3.0)))
def test_marginal_information_is_below_the_conditional(J: FloatArray) -> None:
    H = J.T @ J + 0.1 * np.eye(6)
    marginal = marginal_information(H)
    assert (marginal > 0.0).all()
    assert (marginal <= np.diag(H) + 1e-5).all()
