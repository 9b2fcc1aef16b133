"""Mounts: chains of the log, the machine file, a level sensor, in that order."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.machine import Machine
from lhdmap.messages import Inclination, Joints, LaserScan, Mount, PointCloud
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.mounts import SensorMounts, level_sensor, machine_of

T_BASE_MAST = se3.from_rpy(0.0, 0.0, 0.3, (1.0, 0.2, 0.5))
T_MAST_SCANNER = se3.from_rpy(0.02, -0.05, -0.1, (0.1, 0.0, 1.5))


def test_a_chain_of_transforms_is_followed_whatever_its_order() -> None:
    mounts = SensorMounts(None)
    mounts.update(Mount(0, "mast", "scanner", T_MAST_SCANNER))
    assert not mounts.known("scanner")
    mounts.update(Mount(0, "base_link", "mast", T_BASE_MAST))
    assert mounts.known("scanner")
    found = mounts.of("scanner", "front")
    assert found.parent_frame == "base_link"
    assert found.T_parent_child == pytest.approx(T_BASE_MAST @ T_MAST_SCANNER)
    assert mounts.warnings == []


def test_the_rear_body_is_a_body() -> None:
    mounts = SensorMounts(None)
    mounts.update(Mount(0, "rear_link", "back", T_MAST_SCANNER))
    assert mounts.of("back", "rear").parent_frame == "rear_link"


def test_without_a_chain_the_machine_file_is_taken() -> None:
    machine = Machine()
    mounts = SensorMounts(machine)
    found = mounts.of("unknown", "front")
    assert found.T_parent_child == pytest.approx(machine.mounts["lidar_front"].T_parent_sensor)
    assert "unknown" in mounts.warnings[0]


def test_without_a_machine_it_is_a_level_sensor() -> None:
    mounts = SensorMounts(None)
    assert mounts.of("laser", "front").T_parent_child == pytest.approx(np.eye(4))
    assert mounts.of("back", "rear").T_parent_child[:2, 0] == pytest.approx([-1.0, 0.0])
    assert len(mounts.warnings) == 2
    mounts.of("laser", "front")
    assert len(mounts.warnings) == 2  # said once


@pytest.mark.parametrize("edges", [[("a", "b"), ("b", "a")], [("elsewhere", "a")]])
def test_transforms_that_lead_nowhere(edges: list[tuple[str, str]]) -> None:
    mounts = SensorMounts(None)
    for parent, child in edges:
        mounts.update(Mount(0, parent, child, np.eye(4)))
    assert not mounts.known("a")
    assert mounts.of("a", "front").T_parent_child == pytest.approx(np.eye(4))


def test_a_transform_that_is_not_a_number_is_none() -> None:
    mounts = SensorMounts(None)
    mounts.update(Mount(0, "base_link", "a", np.full((4, 4), np.nan)))
    assert not mounts.known("a")


def test_level_frame_has_the_attitude_and_no_heading() -> None:
    """On a machine that points 10 degrees down, a scanner 2 m up comes 0.35 m forward."""
    mount = Mount(0, "base_link", "a", se3.from_rpy(0.0, 0.0, 0.0, (0.0, 0.0, 2.0)))
    T = level_sensor(mount, 0.0, np.radians(10.0))
    assert T[:3, 3] == pytest.approx([2.0 * np.sin(np.radians(10.0)), 0.0, 2.0 * np.cos(np.radians(10.0))])
    assert T[2, 0] < 0.0  # it looks down


@pytest.mark.parametrize("first", [True, False])
def test_the_inclinometer_s_mount_may_come_after_its_first_messages(first: bool) -> None:
    """Its rotation was then ignored for the whole drive, without a word."""
    pipeline = MappingPipeline(Settings(), None, MappingOptions(cloud=False))
    backwards = Mount(0, "base_link", "imu", se3.from_rpy(0.0, 0.0, math.pi))
    if first:
        pipeline.update("tf_static", backwards)
    for k in range(200):
        pipeline.update("inclinometer", Inclination(k * 10_000_000, "imu", 0.02, 0.05, None, None))
        if not first and k == 5:
            pipeline.update("tf_static", backwards)
    assert pipeline.front_end.inclinometer.attitude.roll_pitch_at(10**9) == pytest.approx((-0.02, -0.05), abs=1e-9)


@pytest.mark.parametrize(("joint", "is_loader"), [("articulation", True), ("wheel_left_joint", False)])
def test_only_an_articulated_machine_is_taken_for_a_loader(joint: str, is_loader: bool, tmp_path: Path) -> None:
    """A robot's wheels are joints, too: its near walls were left out as the loader's own body."""
    with LogWriter(tmp_path / "log.mcap") as writer:
        writer.write("/scan", LaserScan(10**9, "laser", -1.0, 0.1, 0.0, 0.1, 50.0, np.full(21, 5.0, np.float32)))
        writer.write("/other", LaserScan(10**9, "other", -1.0, 0.1, 0.0, 0.1, 50.0, np.full(21, 5.0, np.float32)))
        writer.write("/joint_states", Joints(10**9, {joint: 0.1}, {}))
    with LogSource([tmp_path / "log.mcap"], {"front": "/scan"}) as source:
        assert (machine_of(source, None) is not None) == is_loader


def test_a_scanner_on_the_rear_body_is_known_as_such() -> None:
    mounts = SensorMounts(None)
    mounts.update(Mount(0, "rear_link", "scanner", T_MAST_SCANNER))
    assert not mounts.on_rear_body("front")
    mounts.of("scanner", "front")
    assert mounts.on_rear_body("front")
    assert not mounts.on_rear_body("rear")


def test_a_mount_that_comes_during_the_drive_of_a_3d_scanner_leaves_the_attitude() -> None:
    """`/tf_static` is often published again: the filter began anew with the first messages, and the slope was gone."""
    pipeline = MappingPipeline(Settings(), None, MappingOptions("points", cloud=False))
    walls = np.random.default_rng(0).uniform(-10.0, 10.0, (3000, 3)).astype(np.float32)
    walls[:, 1] = np.sign(walls[:, 1]) * 2.0
    for k in range(400):
        pipeline.update("inclinometer", Inclination(k * 10_000_000, "imu", 0.0, 0.001 * k, None, None))
        if k % 10 == 0:
            pipeline.update("points", PointCloud(k * 10_000_000, "lidar", walls, np.empty(0, np.float32)))
    before = pipeline.front_end.inclinometer.attitude.roll_pitch_at(3_500_000_000)
    pipeline.update("tf_static", Mount(0, "base_link", "other", np.eye(4)))
    assert pipeline.front_end.inclinometer.attitude.roll_pitch_at(3_500_000_001) == pytest.approx(before, abs=1e-6)
    assert before[1] == pytest.approx(0.35, abs=0.02)
