"""The rear scanner: hits at the right place and time, a joint's offset that is learned, a drive that gets better by it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.evaluation.planar_segments import planar_segments
from lhdmap.geometry import se2, se3
from lhdmap.kinematics import T_base_rear
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Joints, LaserScan
from lhdmap.odometry.anchored.rear_view import Behind, JointOffset, RearView, behind
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.track import TrackRows, resample
from lhdmap.scan_matching.matching import Hits, MatchModel, Prior, match
from lhdmap.scan_matching.surface_map import empty_map, insert_all
from lhdmap.simulation.drive import simulate_drift
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.trajectory import read_tum

MODEL = MatchModel(0.012, 3.0, 4.0, 0.05, 6)


def test_a_late_scan_is_moved_to_where_the_machine_was() -> None:
    velocity, late_s = np.array([3.0, 0.2, 0.4]), 0.02
    ranges = np.full(91, 5.0)
    scan = LaserScan(0, "lidar_rear", -0.5 * math.pi, math.pi / 90, 0.0, 0.1, 80.0, ranges)
    T = np.eye(4)
    T[:3, 3] = 1.0, 0.5, 1.8
    seen = behind(RearView(scan, T, late_s, -1.7), velocity, 0.3, -math.inf, 1000)
    angles = -0.5 * math.pi + np.arange(91) * math.pi / 90
    at_its_time = np.column_stack([1.0 + 5.0 * np.cos(angles), 0.5 + 5.0 * np.sin(angles)])
    turn = velocity[2] * late_s
    R = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    assert seen.points[:, :2] == pytest.approx(at_its_time @ R.T + velocity[:2] * late_s, abs=1e-4)
    assert seen.points[:, 2] == pytest.approx(2.1)


def rough_room(rng: np.random.Generator) -> FloatArray:
    """Return hits of a closed, wavy wall around the machine, shape (N, 3)."""
    angles = np.linspace(-math.pi, math.pi, 4000)
    phase = rng.uniform(0.0, 6.0, 3)
    ranges = 5.0 + sum(0.3 / k * np.sin((3 * k + 1) * angles + phase[k - 1]) for k in (1, 2, 3))
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), np.full(angles.size, 0.01)])


@pytest.mark.parametrize("offset_deg", [-0.3, 0.0, 0.4])
def test_the_joints_offset_is_learned(offset_deg: float) -> None:
    wall, joint_x_m = rough_room(np.random.default_rng(1)), -1.7
    map_ = empty_map(0.025, 1024)
    insert_all(map_, wall, 50.0)
    front, rear = wall[wall[:, 0] > 1.0][::5], wall[wall[:, 0] < -2.5][::5]
    turn = -math.radians(offset_deg)
    R = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    joint_at = np.array([joint_x_m, 0.0])
    seen = Behind(np.column_stack([(rear[:, :2] - joint_at) @ R.T + joint_at, rear[:, 2]]), joint_x_m)
    joint, sure = JointOffset(), Prior(np.zeros(3), 1e9 * np.eye(3))
    for _ in range(400):
        both = np.concatenate([front, joint.turned(seen)])
        hits = Hits(both, len(front), True, np.zeros((len(both), 2)))
        joint.update(match(map_, hits, sure, np.zeros(3), MODEL), hits, MODEL, 0.025, joint_x_m)
    assert math.degrees(joint.offset_rad) == pytest.approx(offset_deg, abs=0.05)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rear") / "drift.mcap"
    scenario = DriftScenario(seed=5, drift=DriftSettings(mesh_m=0.08), drive=DriveSettings(distance_m=40.0))
    return simulate_drift(scenario, path).log


class Errors(NamedTuple):
    """Of the odometry and of the final path, metres in the plane and degrees of heading: means over all segments of 10 m.

    `end_m`, `end_deg`: of the odometry's end, seen from its start.
    """

    odometry_m: float
    odometry_deg: float
    final_m: float
    final_deg: float
    end_m: float
    end_deg: float


def errors(log: Path, *, rear: bool, joint_deg: float = 0.0) -> Errors:
    """Return the errors of a drive; `joint_deg` is added to what the joint's encoder says."""
    pipeline = MappingPipeline(Settings(), Machine())
    roles = ["front", "inclinometer", "joints", "tachometer", "tf_static"] + ["rear"] * rear
    with LogSource([log]) as source:
        for role, message in source.messages(roles):
            if isinstance(message, Joints):
                angle = message.positions_rad["articulation"] + math.radians(joint_deg)
                message = message._replace(positions_rad={"articulation": angle})
            pipeline.update(role, message)
    pipeline.finish()
    truth = read_tum(log.with_suffix(".truth.tum"))
    heading = np.unwrap(se3.rpy_from_quaternions(truth.quaternions_xyzw)[:, 2])
    true = TrackRows(truth.stamps_ns, np.column_stack([truth.positions_m, np.zeros((len(heading), 2)), heading]))
    found = [segment_errors(path.rows(), true) for path in (pipeline.track, pipeline.path.final)]
    ends = [rows.poses[[0, -1]][:, [0, 1, 5]] for rows in (true, pipeline.track.rows())]
    end = se2.between(*(se2.between(*pair) for pair in ends))
    return Errors(*found[0], *found[1], float(np.hypot(end[0], end[1])), abs(math.degrees(float(end[2]))))


def segment_errors(rows: TrackRows, truth: TrackRows) -> tuple[float, float]:
    """Return the mean errors over 10 m, in metres and degrees."""
    estimate, true = rows.poses[:, [0, 1, 5]], resample(truth, rows.times_ns).poses[:, [0, 1, 5]]
    found = planar_segments(estimate, true)
    return float(found.translations_m.mean()), 10.0 * found.rotation_deg_per_m


def test_a_tilted_drive_gets_better_by_the_rear_scanner_and_survives_a_wrong_joint(log: Path) -> None:
    """Segments of 10 m of a drive of 40 m."""
    alone, good, wrong = errors(log, rear=False), errors(log, rear=True), errors(log, rear=True, joint_deg=0.3)
    assert good.odometry_m < 0.8 * alone.odometry_m
    assert good.odometry_deg < 0.8 * alone.odometry_deg
    assert (
        wrong.final_m < alone.odometry_m
    )  # once both scanners' hits of one height are aligned, the encoder does not matter
    assert wrong.final_deg < 0.5 * wrong.odometry_deg
    assert (alone.final_m, alone.final_deg) == (alone.odometry_m, alone.odometry_deg)  # nothing is seen again


def test_the_rear_body_is_behind_the_joint() -> None:
    """A wall straight behind a bent machine is seen where it is: what `RearScans` builds on."""
    machine = Machine()
    T = T_base_rear(math.radians(30.0), machine)
    joint = np.array([-machine.dimensions.joint_to_front_axle_m, 0.0])
    assert np.hypot(*(T[:2, 3] - joint)) == pytest.approx(machine.dimensions.joint_to_rear_axle_m)
    assert T[1, 3] > 0.0  # bent to the left: the rear stands left of the front body's axis
