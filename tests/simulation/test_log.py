"""The log of a simulated drive against the contract, read by an independent reader."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import UsageError
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.scenario import DriftScenario, load_scenario
from lhdmap.simulation.world import DriftWorld
from lhdmap.trajectory import read_tum

CONTRACT = {
    "/lidar/front/scan": ("sensor_msgs/msg/LaserScan", "lidar_front"),
    "/lidar/rear/scan": ("sensor_msgs/msg/LaserScan", "lidar_rear"),
    "/inclinometer": ("sensor_msgs/msg/Imu", "inclinometer"),
    "/machine/joints": ("sensor_msgs/msg/JointState", None),
    "/machine/tachometer": ("geometry_msgs/msg/TwistStamped", None),
    "/machine/pressure/transmission": ("sensor_msgs/msg/FluidPressure", None),
    "/machine/pressure/lift": ("sensor_msgs/msg/FluidPressure", None),
    "/machine/pressure/tilt": ("sensor_msgs/msg/FluidPressure", None),
    "/operation/mode": ("std_msgs/msg/String", None),
    "/tf_static": ("tf2_msgs/msg/TFMessage", None),
    "/ground_truth/odometry": ("nav_msgs/msg/Odometry", "map"),
}
Decoded = list[tuple[str, str, int, Any]]


@pytest.fixture(scope="module")
def drive(scenario: DriftScenario, tmp_path_factory: pytest.TempPathFactory) -> SimulatedDrive:
    swept = replace(scenario, scanner=replace(scenario.scanner, sweep=True))
    folder = tmp_path_factory.mktemp("drive")
    return simulate_drift(swept, folder / "drive.mcap", mesh_path=folder / "drive.ply")


@pytest.fixture(scope="module")
def decoded(drive: SimulatedDrive) -> Decoded:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with drive.log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, schema.name if schema else "", message.log_time, content)
            for schema, channel, message, content in reader.iter_decoded_messages(log_time_order=False)
        ]


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def test_topics_types_and_frames_are_the_contracts(decoded: Decoded) -> None:
    assert {(topic, kind) for topic, kind, _, _ in decoded} == {(topic, kind) for topic, (kind, _) in CONTRACT.items()}
    for topic, _, _, message in decoded:
        frame = CONTRACT[topic][1]
        if frame is not None:
            assert message.header.frame_id == frame


def test_messages_are_in_the_order_of_their_log_time(decoded: Decoded) -> None:
    times = np.array([time for _, _, time, _ in decoded])
    assert (np.diff(times) >= 0).all()


def test_mounts_come_first_and_name_every_sensor(decoded: Decoded) -> None:
    mounts = [t for topic, _, _, m in decoded if topic == "/tf_static" for t in m.transforms]
    pairs = {(mount.header.frame_id, mount.child_frame_id) for mount in mounts}
    assert pairs == {("base_link", "lidar_front"), ("rear_link", "lidar_rear"), ("base_link", "inclinometer")}
    assert decoded[0][0] == "/tf_static"


def test_scans_are_those_of_the_scanner(decoded: Decoded, drive: SimulatedDrive) -> None:
    scans = [message for topic, _, _, message in decoded if topic == "/lidar/front/scan"]
    assert len(scans) == drive.scans
    for scan in scans[:: len(scans) - 1]:
        assert len(scan.ranges) == 381
        assert np.degrees([scan.angle_min, scan.angle_increment]) == pytest.approx([-95.0, 0.5], abs=1e-4)
        assert scan.time_increment == pytest.approx(0.04 * 0.5 / 360.0, rel=1e-4)
        finite = np.array(scan.ranges)[np.isfinite(scan.ranges)]
        assert finite.size > 350
        assert finite.max() <= scan.range_max


def test_truth_is_exact_at_every_front_scan(decoded: Decoded, drive: SimulatedDrive, scenario: DriftScenario) -> None:
    stamps = [stamp_ns(message) for topic, _, _, message in decoded if topic == "/lidar/front/scan"]
    truth = read_tum(drive.truth_file)
    assert truth.stamps_ns.tolist() == stamps == drive.truth.stamps_ns.tolist()
    odometry = [message for topic, _, _, message in decoded if topic == "/ground_truth/odometry"]
    positions = np.array([[m.pose.pose.position.x, m.pose.pose.position.y, m.pose.pose.position.z] for m in odometry])
    assert np.abs(positions - truth.positions_m).max() < 1e-6
    assert odometry[0].child_frame_id == "base_link"
    table = DriftWorld(scenario).history.rows
    assert truth.positions_m[0] == pytest.approx(table[0, :3], abs=1e-6)
    assert truth.positions_m[-1] == pytest.approx(table[-1, :3], abs=1e-3)


def test_the_cloud_by_the_truth_lies_on_the_written_mesh(decoded: Decoded, drive: SimulatedDrive) -> None:
    """Mounts, stamps, angles and truth of the log, put together without lhdmap, give the surface within the noise."""
    import open3d as o3d
    from scipy.spatial.transform import Rotation

    mesh = o3d.t.io.read_triangle_mesh(str(drive.mesh_file))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh.to_legacy()))
    mount = next(
        t
        for topic, _, _, m in decoded
        if topic == "/tf_static"
        for t in m.transforms
        if t.child_frame_id == "lidar_front"
    )
    q, p = mount.transform.rotation, mount.transform.translation
    R_base_scanner, p_base_scanner = Rotation.from_quat([q.x, q.y, q.z, q.w]), np.array([p.x, p.y, p.z])
    truth, scans = drive.truth, [m for topic, _, _, m in decoded if topic == "/lidar/front/scan"]
    distances = []
    for index in range(12):  # at rest: no motion within the sweep
        ranges = np.array(scans[index].ranges)
        seen = np.isfinite(ranges)
        angles = scans[index].angle_min + scans[index].angle_increment * np.arange(ranges.size)
        points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles), 0 * angles], axis=1)[seen]
        points = R_base_scanner.apply(points) + p_base_scanner
        points = Rotation.from_quat(truth.quaternions_xyzw[index]).apply(points) + truth.positions_m[index]
        distances.append(scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy())  # type: ignore[call-overload]
    everything = np.concatenate(distances)
    assert np.median(everything) < 0.012
    assert np.percentile(everything, 99) < 0.04


def test_the_scenario_beside_the_log_makes_the_same_log(drive: SimulatedDrive, tmp_path: Path) -> None:
    again = simulate_drift(load_scenario(drive.scenario_file), tmp_path / "again.mcap")
    assert again.log.read_bytes() == drive.log.read_bytes()
    assert again.truth_file.read_bytes() == drive.truth_file.read_bytes()


def test_another_seed_makes_another_world(scenario: DriftScenario, tmp_path: Path) -> None:
    short = replace(
        scenario, drive=replace(scenario.drive, distance_m=2.0), scanner=replace(scenario.scanner, rear=False)
    )
    logs = [simulate_drift(replace(short, seed=seed), tmp_path / f"{seed}.mcap") for seed in (1, 2)]
    assert logs[0].log.read_bytes() != logs[1].log.read_bytes()
    assert not np.allclose(logs[0].truth.positions_m[0], logs[1].truth.positions_m[0], atol=0.1)


def test_truth_changes_nothing_else_in_the_log(scenario: DriftScenario, tmp_path: Path) -> None:
    from lhdmap.simulation.drive import records

    short = replace(scenario, drive=replace(scenario.drive, distance_m=2.0))
    with_truth = [r for r in records(DriftWorld(short)) if r.topic != "/ground_truth/odometry"]
    without = list(records(DriftWorld(replace(short, truth=False))))
    assert Counter(r.topic for r in with_truth) == Counter(r.topic for r in without)
    for a, b in zip(with_truth, without, strict=True):
        assert (a.topic, a.log_time_ns) == (b.topic, b.log_time_ns)
        assert repr(a.message) == repr(b.message)


def test_nothing_is_overwritten(drive: SimulatedDrive, scenario: DriftScenario, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="exists already"):
        simulate_drift(scenario, drive.log)
    (tmp_path / "x.truth.tum").write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match=r"x\.truth\.tum"):
        simulate_drift(scenario, tmp_path / "x.mcap")
    assert not (tmp_path / "x.mcap").exists()
