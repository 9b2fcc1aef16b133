"""Projection against exact geometry: motion within the sweep, mounts, articulation, validity, the own bodies."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.geometry import articulated, se3
from lhdmap.integration.beams import beam_table, scan_points, sweep_stamps_ns, table_of
from lhdmap.integration.project import BeamCounts, Limits, SweepPoints, SweepPoses, project_cloud, project_scan
from lhdmap.integration.self_filter import Rig, rig_of, self_hits
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import BodyBox, Machine
from lhdmap.messages import FloatArray, LaserScan, Mount, PointCloud

from tests.integration import rooms

BARE = Machine(bodies={"none": BodyBox("base_link", (50.0, 50.0, 50.0), (50.1, 50.1, 50.1))})
STILL = SweepPoses(np.eye(4), np.eye(4), 0.0, 0.0)


def turning(t: float) -> FloatArray:
    """A machine at 24 km/h that turns by 40 degrees a second and pitches."""
    return se3.from_rpy(0.02, 0.05 * t, 0.7 * t, (6.7 * t, 0.4 * t, 0.1 * t - 1.5))


def no_angle(_: float) -> float:
    return 0.0


def projected(scan: LaserScan, poses: SweepPoses, rig: Rig) -> tuple[FloatArray, BeamCounts]:
    out = SweepPoints.of_size(len(scan.ranges_m))
    limits = Limits(scan.range_min_m, scan.range_max_m)
    counts = BeamCounts(*project_scan(scan.ranges_m, table_of(scan), limits, sweep_stamps_ns(scan), poses, rig, out))
    return out.points_map[: counts.kept], counts


@pytest.mark.parametrize(
    ("surface", "distance"), [(rooms.room_range, rooms.room_distance), (rooms.tube_range, rooms.tube_distance)]
)
@pytest.mark.parametrize("step_rad", [rooms.INCREMENT_RAD, -rooms.INCREMENT_RAD])
def test_motion_within_a_sweep_is_undone(surface: rooms.Surface, distance: rooms.Distance, step_rad: float) -> None:
    mount = rooms.mount_of(BARE, "lidar_front")
    rig = rig_of(mount, BARE, 0.0)
    scan = rooms.sweep(
        surface, lambda t: turning(t) @ mount.T_parent_child, 0.1, 0.02, "lidar_front", step_rad
    )  # fmt: skip
    moving, _ = projected(scan, rooms.ends(turning, no_angle, 0.1, 0.02), rig)
    assert np.quantile(distance(moving), 0.99) < 1e-4
    frozen, _ = projected(scan, SweepPoses(turning(0.1), turning(0.1), 0.0, 0.0), rig)
    assert np.quantile(distance(frozen), 0.9) > 0.03


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rear_scanner_follows_the_articulation(sign: float) -> None:
    def angle(t: float) -> float:
        return sign * (0.3 + 0.26 * t)

    mount = rooms.mount_of(BARE, "lidar_rear")
    rig = rig_of(mount, BARE, 0.0)
    scan = rooms.sweep(
        rooms.tube_range, lambda t: rooms.sensor_at(mount, BARE, turning, angle, t), 0.05, 0.02, "lidar_rear"
    )
    points, counts = projected(scan, rooms.ends(turning, angle, 0.05, 0.02), rig)
    assert counts.kept > 300
    assert np.quantile(rooms.tube_distance(points), 0.99) < 1e-3
    straight, _ = projected(scan, rooms.ends(turning, no_angle, 0.05, 0.02), rig)
    assert np.median(rooms.tube_distance(straight)) > 0.05


def test_a_sweep_of_large_rotation_is_exact() -> None:
    def spinning(t: float) -> FloatArray:
        return se3.from_rpy(0.0, 0.0, 25.0 * t)

    rig = rig_of(Mount(0, "base_link", "s", np.eye(4)), BARE, 0.0)
    scan = rooms.sweep(rooms.room_range, spinning, 0.0, 0.1, "s")
    points, _ = projected(scan, rooms.ends(spinning, no_angle, 0.0, 0.1), rig)
    assert rooms.room_distance(points).max() < 1e-5


@pytest.mark.parametrize("articulation", [-0.6, -0.1, 0.0, 0.4])
def test_the_rear_body_is_where_the_kinematics_put_it(articulation: float) -> None:
    machine = Machine()
    size = machine.dimensions
    lengths = (size.joint_to_front_axle_m, size.joint_to_rear_axle_m)
    assert articulated.T_base_rear(articulation, *lengths) == pytest.approx(
        T_base_rear(articulation, machine), abs=1e-12
    )
    product = articulated.T_base_rear(articulation, *lengths) @ articulated.T_rear_base(articulation, *lengths)
    assert product == pytest.approx(np.eye(4), abs=1e-12)


def test_beams_without_a_return_are_left_out() -> None:
    ranges = np.array([1.0, np.inf, np.nan, -np.inf, 0.0, 0.04, 90.0, -2.0, 80.0, 0.05], dtype=np.float32)
    scan = LaserScan(5, "s", -0.2, 0.05, 0.0, 0.05, 80.0, ranges)
    points, counts = projected(scan, STILL, rig_of(Mount(0, "base_link", "s", np.eye(4)), BARE, 0.0))
    assert counts == (3, 7, 0, 0)
    same, beams = scan_points(scan)
    assert beams.tolist() == [0, 8, 9]
    assert points == pytest.approx(same, abs=1e-12)
    assert np.linalg.norm(points, axis=1) == pytest.approx([1.0, 80.0, 0.05], rel=1e-6)


def test_directions_honour_offset_and_sign_of_the_angles() -> None:
    forward, backward = beam_table(-0.4, 0.1, 9), beam_table(0.4, -0.1, 9)
    assert forward.sin == pytest.approx(backward.sin[::-1], abs=1e-15)
    assert forward.cos == pytest.approx(np.cos(np.linspace(-0.4, 0.4, 9)), abs=1e-15)
    assert beam_table(-0.4, 0.1, 9) is forward


def test_sweep_stamps_are_those_of_the_first_and_last_beam() -> None:
    scan = LaserScan(1_000, "s", 0.0, 0.1, 1e-6, 0.0, 9.0, np.ones(5, dtype=np.float32))
    assert sweep_stamps_ns(scan) == (1_000, 5_000)
    assert sweep_stamps_ns(scan._replace(time_increment_s=-1e-6)) == (1_000, -3_000)
    cloud = PointCloud(9_000, "s", np.ones((3, 3), np.float32), np.array([-2e-6, 0.0, 1e-6], np.float32))
    assert sweep_stamps_ns(cloud) == (7_000, 10_000)
    assert sweep_stamps_ns(cloud._replace(time_offsets_s=np.zeros(0, np.float32))) == (9_000, 9_000)


@pytest.mark.parametrize("articulation", [-0.5, 0.0, 0.5])
def test_both_bodies_are_filtered_and_nothing_else(articulation: float) -> None:
    machine = Machine()
    mount = rooms.mount_of(machine, "lidar_front")
    rng = np.random.default_rng(4)
    points_base = rng.uniform([-9.0, -4.0, -0.5], [5.0, 4.0, 3.5], (4000, 3))
    T_base_sensor = mount.T_parent_child
    points_sensor = (points_base - T_base_sensor[:3, 3]) @ T_base_sensor[:3, :3]
    inside = in_bodies(machine, points_base, articulation, margin_m=0.1)
    assert 0.05 < inside.mean() < 0.6
    cloud = points_sensor.astype(np.float32)
    out = SweepPoints.of_size(4000)
    rig = rig_of(mount, machine, 0.1)
    poses = SweepPoses(np.eye(4), np.eye(4), articulation, articulation)
    counts = BeamCounts(*project_cloud(cloud, np.zeros(0, np.float32), Limits(0.0, 50.0), (0, 0), poses, rig, out))
    assert counts.self_hits == int(inside.sum())
    assert out.points_map[: counts.kept] == pytest.approx(points_base[~inside], abs=1e-5)
    assert np.array_equal(self_hits(rig, points_sensor, articulation), inside)


def in_bodies(machine: Machine, points_base: FloatArray, articulation: float, margin_m: float) -> np.ndarray:
    """The same question asked in another way: each body's points in its own frame, by matrices."""
    T = np.linalg.inv(T_base_rear(articulation, machine))
    points_rear = points_base @ T[:3, :3].T + T[:3, 3]
    hit = np.zeros(len(points_base), dtype=bool)
    for frame, points in (("base_link", points_base), ("rear_link", points_rear)):
        for low, high in machine.boxes(frame):
            hit |= ((points >= low - margin_m) & (points <= high + margin_m)).all(axis=1)
    return hit


@pytest.mark.parametrize("name", ["lidar_front", "lidar_rear"])
@pytest.mark.parametrize("articulation", [-0.7, 0.0, 0.7])
def test_the_reach_of_the_self_filter_covers_both_bodies(name: str, articulation: float) -> None:
    machine = Machine()
    rig = rig_of(rooms.mount_of(machine, name), machine, 0.2)
    T_base_sensor = rig.T_parent_sensor if not rig.on_rear else T_base_rear(articulation, machine) @ rig.T_parent_sensor
    for frame, boxes in (("base_link", rig.front_boxes), ("rear_link", rig.rear_boxes)):
        T_base_body = np.eye(4) if frame == "base_link" else T_base_rear(articulation, machine)
        for box in boxes:
            corners = np.array(np.meshgrid(*box.reshape(2, 3).T)).reshape(3, -1)
            in_base = T_base_body[:3, :3] @ corners + T_base_body[:3, 3:]
            assert np.linalg.norm(in_base.T - T_base_sensor[:3, 3], axis=1).max() <= rig.reach_m


def test_a_clouds_points_are_compensated_by_their_own_times() -> None:
    rng = np.random.default_rng(7)
    times = rng.uniform(-0.04, 0.06, 500).astype(np.float32)
    targets = rng.uniform(-8.0, 8.0, (500, 3))
    first, last = float(times.min()), float(times.max())
    seen = [
        se3.inverse(turning(0.5 + t)) @ np.append(p, 1.0) for t, p in zip(times.astype(float), targets, strict=True)
    ]
    cloud = np.array(seen)[:, :3].astype(np.float32)
    rig = rig_of(Mount(0, "base_link", "s", np.eye(4)), BARE, 0.0)
    poses = rooms.ends(turning, no_angle, 0.5 + first, last - first)
    out = SweepPoints.of_size(500)
    counts = BeamCounts(*project_cloud(cloud, times, Limits(0.0, 50.0), (700, 1_700), poses, rig, out))
    assert counts.kept == 500
    assert np.abs(out.points_map - targets).max() < 2e-3  # roll, pitch and yaw together do not turn about one axis
    assert np.array_equal(out.stamps_ns, 700 + np.round((times - first) / (last - first) * 1000))
    assert out.viewpoint_map == pytest.approx(turning(0.5 + first)[:3, 3], abs=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda m: m._replace(parent_frame="bucket"), "base_link or rear_link"),
        (lambda m: m._replace(T_parent_child=np.diag([1.0, 1.0, 2.0, 1.0])), "rigid"),
        (lambda m: m._replace(T_parent_child=np.eye(3)), "rigid"),
    ],
)
def test_a_wrong_mount_is_refused_with_its_name(change: Callable[[Mount], Mount], said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        rig_of(change(Mount(0, "base_link", "lidar_x", np.eye(4))), Machine(), 0.1)
    assert "lidar_x" in str(caught.value)


def test_tilt_puts_the_far_floor_where_it_is() -> None:
    pitch = math.radians(2.5)
    rig = rig_of(Mount(0, "base_link", "s", se3.from_rpy(0.0, pitch, 0.0, (0.0, 0.0, 1.8))), BARE, 0.0)
    scan = LaserScan(0, "s", 0.0, 0.1, 0.0, 0.1, 80.0, np.array([1.8 / math.sin(pitch)], dtype=np.float32))
    points, _ = projected(scan, STILL, rig)
    assert points[0] == pytest.approx([1.8 / math.tan(pitch), 0.0, 0.0], abs=1e-4)
    nose_down = se3.from_rpy(0.0, math.radians(1.0), 0.0)
    lower, _ = projected(scan, SweepPoses(nose_down, nose_down, 0.0, 0.0), rig)
    assert lower[0, 2] < -0.5
