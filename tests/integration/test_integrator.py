"""The stage as a whole: a machine drives through a tube, and the cloud lies on its wall."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.integrator import IntegrationSettings, Integrator
from lhdmap.integration.project import SweepPoses
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, PointCloud
from lhdmap.settings import load_section

from tests.integration import rooms

MACHINE = Machine()
SENSORS = ("lidar_front", "lidar_rear")
MOUNTS = [rooms.mount_of(MACHINE, name) for name in SENSORS]
STILL = SweepPoses(np.eye(4), np.eye(4), 0.0, 0.0)


def driving(t: float) -> FloatArray:
    """Along the tube at 12 km/h, pitching by 0.6 degrees, its floor 1.5 m below the tube's axis."""
    return se3.from_rpy(0.0, 0.01 * math.sin(2.0 * t), 0.02 * math.sin(t), (3.3 * t, 0.2 * math.sin(t), -1.5))


def bending(t: float) -> float:
    return 0.2 * math.sin(t)


def drive(integrator: Integrator, seconds: float = 1.2, noise_m: float = 0.0) -> None:
    rng = np.random.default_rng(0)
    for t in np.arange(0.0, seconds, 0.04):
        for mount in MOUNTS:
            scan = rooms.sweep(
                rooms.tube_range,
                lambda s, mount=mount: rooms.sensor_at(mount, MACHINE, driving, bending, s),  # type: ignore[misc]
                float(t),
                0.02,
                mount.child_frame,
            )
            noisy = scan.ranges_m + rng.normal(0.0, noise_m, len(scan.ranges_m)).astype(np.float32)
            integrator.update(scan._replace(ranges_m=noisy), rooms.ends(driving, bending, float(t), 0.02))


@pytest.fixture(scope="module")
def integrated() -> tuple[Integrator, GridCloud]:
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    drive(integrator, noise_m=0.012)
    return integrator, integrator.cloud()


def test_the_cloud_lies_on_the_wall(integrated: tuple[Integrator, GridCloud]) -> None:
    integrator, cloud = integrated
    distances = rooms.tube_distance(cloud.points_m.astype(float))
    assert len(cloud) > 1000
    assert np.median(distances) < 0.01
    assert np.quantile(distances, 0.95) < 0.04
    assert np.quantile(cloud.points_m[:, 0], [0.01, 0.99]) == pytest.approx([-40, 40], abs=20)
    totals = integrator.totals
    assert totals.kept + totals.no_return + totals.self_hits + totals.strays == 60 * rooms.BEAMS
    assert integrator.grid.hits == totals.kept


def test_its_normals_point_into_the_tube(integrated: tuple[Integrator, GridCloud]) -> None:
    _, cloud = integrated
    assert cloud.normals is not None
    assert cloud.curvature is not None
    inward = -cloud.points_m[:, 1:] / np.linalg.norm(cloud.points_m[:, 1:], axis=1, keepdims=True)
    known = np.linalg.norm(cloud.normals, axis=1) > 0.5
    assert known.mean() > 0.9
    near = known & (np.abs(cloud.points_m[:, 0]) < 10.0)
    assert ((cloud.normals[near, 1:] * inward[near]).sum(axis=1) > 0.9).mean() > 0.9
    assert ((cloud.curvature >= 0.0) & (cloud.curvature <= 1 / 3 + 1e-6)).all()


def test_stamps_are_those_of_the_beams(integrated: tuple[Integrator, GridCloud]) -> None:
    _, cloud = integrated
    assert cloud.stamps_ns is not None
    assert cloud.stamps_ns.min() >= 0
    assert cloud.stamps_ns.max() <= 1_180_000_000
    assert (cloud.stamps_ns % 40_000_000 > 0).mean() > 0.9


def test_two_runs_give_the_same_bytes(integrated: tuple[Integrator, GridCloud]) -> None:
    _, first = integrated
    again = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    drive(again, noise_m=0.012)
    second = again.cloud()
    assert first.points_m.tobytes() == second.points_m.tobytes()
    assert first.normals is not None
    assert second.normals is not None
    assert first.normals.tobytes() == second.normals.tobytes()


def test_it_runs_in_a_thread_beside_another() -> None:
    alone, threaded = (Integrator(IntegrationSettings(), MOUNTS, MACHINE) for _ in range(2))
    worker = threading.Thread(target=drive, args=(threaded, 0.2))
    worker.start()
    drive(alone, 0.2)
    worker.join()
    assert alone.grid.voxels.tobytes() == threaded.grid.voxels.tobytes()


def test_range_limits_are_the_tighter_of_scanner_and_settings() -> None:
    settings = IntegrationSettings(range_min_m=1.0, range_max_m=10.0, stray_m=math.inf)
    ranges = np.array([0.5, 5.0, 9.9, 10.1, 30.0], dtype=np.float32)
    scan = LaserScan(0, "lidar_front", 0.0, 0.01, 0.0, 0.1, 9.95, ranges)
    integrator = Integrator(settings, MOUNTS, MACHINE)
    assert integrator.update(scan, STILL).counts == (2, 3, 0, 0)
    assert integrator.update(scan._replace(range_max_m=80.0, range_min_m=7.0), STILL).counts == (1, 4, 0, 0)


def test_dust_is_left_out_and_what_stands_in_front_of_a_wall_is_kept() -> None:
    ranges = np.full(60, 8.0, dtype=np.float32)
    ranges[[5, 20, 59]] = [2.0, 7.0, 3.0]  # single returns in front of the wall
    ranges[[30, 31]] = 4.0  # a pole two beams wide
    ranges[40:] += 3.0  # a step of the wall
    ranges[50] = 8.9
    ranges[53:56] = [np.inf, 1.5, np.nan]
    scan = LaserScan(0, "lidar_front", -0.1, 0.005, 0.0, 0.1, 80.0, ranges)
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    counts = integrator.update(scan, STILL).counts
    assert counts == (60 - 2 - 5, 2, 0, 5)
    assert Integrator(IntegrationSettings(stray_m=math.inf), MOUNTS, MACHINE).update(scan, STILL).counts[0] == 58


def test_dust_in_a_drift_stays_out_of_the_cloud() -> None:
    rng = np.random.default_rng(1)
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    for t in np.arange(0.0, 0.8, 0.04):
        scan = rooms.sweep(
            rooms.tube_range, lambda s: driving(s) @ MOUNTS[0].T_parent_child, float(t), 0.02, SENSORS[0]
        )
        dusty = rng.random(rooms.BEAMS) < 0.03
        ranges = np.where(dusty, scan.ranges_m * rng.uniform(0.1, 1.0, rooms.BEAMS), scan.ranges_m).astype(np.float32)
        integrator.update(scan._replace(ranges_m=ranges), rooms.ends(driving, bending, float(t), 0.02))
    distances = rooms.tube_distance(integrator.cloud().points_m.astype(float))
    assert np.quantile(distances, 0.95) < 0.05
    assert integrator.totals.strays > 100


def test_a_cloud_message_is_taken_like_a_scan() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(4.0, 9.0, (300, 3)).astype(np.float32)
    message = PointCloud(1_000, "lidar_front", points, np.zeros(0, np.float32))
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    found = integrator.update(message, STILL)
    T = MOUNTS[0].T_parent_child
    assert found.points_map == pytest.approx(points.astype(float) @ T[:3, :3].T + T[:3, 3], abs=1e-5)
    assert integrator.grid.voxels["first_ns"].tolist() == [1_000] * len(integrator.grid)


def test_a_frame_without_a_mount_is_an_error_that_lists_those_known() -> None:
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    scan = LaserScan(0, "laser7", 0.0, 0.1, 0.0, 0.1, 9.0, np.ones(3, dtype=np.float32))
    with pytest.raises(InputError, match="laser7") as caught:
        integrator.update(scan, STILL)
    assert "lidar_front" in str(caught.value)


def test_a_sweep_without_a_pose_is_refused_and_counted() -> None:
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    scan = LaserScan(0, "lidar_front", 0.0, 0.1, 0.0, 0.1, 9.0, np.full(3, 5.0, dtype=np.float32))
    lost = STILL._replace(T_map_base_end=np.full((4, 4), np.nan))
    assert integrator.update(scan, lost).counts.kept == 0
    assert integrator.update(scan, STILL._replace(articulation_end_rad=math.nan)).counts.kept == 0
    assert integrator.totals.refused_sweeps == 2
    assert len(integrator.grid) == 0


def test_an_empty_scan_and_an_empty_map_are_fine() -> None:
    integrator = Integrator(IntegrationSettings(), MOUNTS, MACHINE)
    scan = LaserScan(0, "lidar_front", 0.0, 0.1, 0.0, 0.1, 9.0, np.zeros(0, dtype=np.float32))
    assert integrator.update(scan, STILL).counts == (0, 0, 0, 0)
    assert len(integrator.cloud()) == 0


def test_the_settings_are_a_section() -> None:
    section = load_section(IntegrationSettings, "integration", {"voxel_size_m": [0.1, 0.1, 0.1], "min_hits": 1})
    assert section.voxel_size_m == (0.1, 0.1, 0.1)
