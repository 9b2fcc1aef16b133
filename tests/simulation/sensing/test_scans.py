"""When scans are complete, and the clouds of the 3D scanner against the surface that they are of."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import ConfigError
from lhdmap.geometry import se3
from lhdmap.machine import Machine
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.scanner import beams_of
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sensing.sections import CloudSettings, ScannerSettings, SensorSettings
from lhdmap.simulation.sensing.sensor import read_all
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.world import DriftWorld

from tests.simulation.sensing.machines import Room, history, of_role, readings


def test_a_scan_is_complete_when_its_last_beam_is() -> None:
    settings = ScannerSettings(beams=91, sweep=True)
    records = of_role(readings(sensors_of(Machine(), SensorSettings(settings), seed=1), history(1.0)), "front")
    last_ns = beams_of(settings).times_s[-1] * 1e9
    assert all(0.0 <= r.log_time_ns - r.message.stamp_ns - last_ns <= 1.0 for r in records)
    assert [r.message.stamp_ns - START_NS for r in records] == [40_000_000 * k for k in range(25)]


def test_the_scanners_are_not_synchronised() -> None:
    records = readings(sensors_of(Machine(), SensorSettings(), seed=1), history(1.0))
    front, rear = (of_role(records, role)[0].message.stamp_ns for role in ("front", "rear"))
    assert rear - front == round(0.37 * 40e6)


def test_a_scan_is_cast_once() -> None:
    room = Room()
    count = len(of_role(readings(sensors_of(Machine(), SensorSettings(), seed=1), history(2.0), room), "front"))
    assert (room.casts, count) == (51 + 50, 51)


def test_truth_comes_with_the_front_scans() -> None:
    settings = SensorSettings(ScannerSettings(beams=91, sweep=True))
    records = readings(sensors_of(Machine(), settings, seed=1), history(3.0, X=lambda t: 2.0 * t))
    scans, truth = of_role(records, "front"), of_role(records, "ground_truth")
    assert [r.message.stamp_ns for r in truth] == [r.message.stamp_ns for r in scans]
    messages: list[Any] = [record.message for record in truth]
    assert [m.position_m[0] for m in messages] == pytest.approx([0.08 * k for k in range(len(truth))])


def test_a_machine_without_the_mount_of_a_scanner_is_refused() -> None:
    mounts = {name: mount for name, mount in Machine().mounts.items() if name != "lidar_rear"}
    with pytest.raises(ConfigError, match=r"\[mount.lidar_rear\]"):
        sensors_of(replace(Machine(), mounts=mounts), SensorSettings(), seed=1)
    alone = SensorSettings(ScannerSettings(rear=False))
    assert "rear" not in {sensor.name for sensor in sensors_of(replace(Machine(), mounts=mounts), alone, seed=1)}


def test_clouds_put_into_the_map_by_the_truth_lie_on_the_mesh(scenario: DriftScenario) -> None:
    """Each point by the pose at its own time, while the machine drives through a bend; the log's mount leads there."""
    import open3d as o3d

    cloud = CloudSettings(enabled=True, rings=8, columns=90, noise_m=0.0)
    world = DriftWorld(replace(scenario, cloud=cloud, scanner=replace(scenario.scanner, occlusion=False)))
    mesh = world.mesh_between(0.0, world.drift.line.length_m)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices_m.astype(np.float32)), o3d.core.Tensor(mesh.triangles))  # type: ignore[call-overload]
    sensors = sensors_of(world.machine, world.scenario.sensors, seed=1)
    wanted = [sensor for sensor in sensors if sensor.name in ("points", "tf_static")]
    records = list(read_all(wanted, world.history, world))
    mount: Any = next(r.message for r in records if getattr(r.message, "child_frame", "") == "lidar_points")
    clouds: list[Any] = [r.message for r in of_role(records, "points")]
    assert len(clouds) > 50
    assert np.ptp(clouds[20].time_offsets_s) > 0.09
    for message in clouds[10::15]:
        times = (message.stamp_ns - START_NS) * 1e-9 + message.time_offsets_s.astype(float)
        states = world.history.at(times)
        poses = np.array([se3.from_rpy(s[3], s[4], s[5], (s[0], s[1], s[2])) for s in states]) @ mount.T_parent_child
        points = np.einsum("nij,nj->ni", poses[:, :3, :3], message.points_m) + poses[:, :3, 3]
        distance = scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()  # type: ignore[call-overload]
        assert len(points) > 500
        assert distance.max() < 2e-3
