"""The machine's motion: on the floor, without side slip, as fast as asked."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.geometry import se3
from lhdmap.kinematics import T_base_rear, heading_rate
from lhdmap.messages import FloatArray
from lhdmap.simulation.driving import TABLE_RATE_HZ, slip_factors
from lhdmap.simulation.history import Column
from lhdmap.simulation.raycast import Surface
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriveSettings
from lhdmap.simulation.sensing.sections import WheelSettings
from lhdmap.simulation.timetable import timetable
from lhdmap.simulation.world import DriftWorld

from tests.simulation.conftest import COARSE, SHORT


def poses(world: DriftWorld, every: int = 150) -> list[tuple[FloatArray, float]]:
    """Poses of `base_link`, shape (4, 4), and articulation, some in a drive."""
    rows = world.history.rows[::every]
    return [(se3.from_rpy(row[3], row[4], row[5], tuple(row[:3])), float(row[6])) for row in rows]


def height_of_mesh(world: DriftWorld, points_m: FloatArray) -> FloatArray:
    """Height of the meshed floor under points (N, 3), averaged over a tyre's footprint."""
    surface = Surface(world.mesh_between(0.0, world.drift.line.length_m))
    offsets = np.stack(np.meshgrid([-0.25, 0.0, 0.25], [-0.25, 0.0, 0.25]), axis=-1).reshape(-1, 2)
    starts = np.repeat(points_m - surface.origin_m, len(offsets), axis=0) + np.column_stack(
        [np.tile(offsets, (len(points_m), 1)), np.full(len(points_m) * len(offsets), 1.0)]
    )
    rays = np.hstack([starts, np.tile([0.0, 0.0, -1.0], (len(starts), 1))]).astype(np.float32)
    heights = starts[:, 2] - surface.cast(rays) + surface.origin_m[2]
    return heights.reshape(len(points_m), -1).mean(axis=1)


def test_wheels_stand_on_the_meshed_floor(world: DriftWorld) -> None:
    half = 0.5 * world.machine.dimensions.track_m
    front_left, front_right, rear = [], [], []
    for T_map_base, bend in poses(world):
        T_map_rear = T_map_base @ T_base_rear(bend, world.machine)
        front_left.append((T_map_base @ [0.0, half, 0.0, 1.0])[:3])
        front_right.append((T_map_base @ [0.0, -half, 0.0, 1.0])[:3])
        rear.append([(T_map_rear @ [0.0, side, 0.0, 1.0])[:3] for side in (half, -half)])
    for wheel in (np.array(front_left), np.array(front_right)):
        assert np.abs(wheel[:, 2] - height_of_mesh(world, wheel)).max() < 0.02
    axle = np.array(rear)
    ground = height_of_mesh(world, axle.reshape(-1, 3)).reshape(-1, 2).mean(axis=1)
    assert np.abs(axle[:, :, 2].mean(axis=1) - ground).max() < 0.03


def test_roll_and_pitch_have_rep_103_signs(world: DriftWorld) -> None:
    """Positive roll: the left side is higher. Positive pitch: the nose is lower."""
    rows = world.history.rows
    left = np.array([(T @ [0.0, 1.0, 0.0, 1.0])[2] - (T @ [0.0, -1.0, 0.0, 1.0])[2] for T, _ in poses(world)])
    nose = np.array([(T @ [1.0, 0.0, 0.0, 1.0])[2] - (T @ [0.0, 0.0, 0.0, 1.0])[2] for T, _ in poses(world)])
    roll, pitch = rows[::150, 3], rows[::150, 4]
    assert (left[roll > 0.002] > 0).all()
    assert (left[roll < -0.002] < 0).all()
    assert (nose[pitch > 0.002] < 0).all()
    assert (nose[pitch < -0.002] > 0).all()
    assert np.ptp(roll) > math.radians(0.5)


@pytest.mark.parametrize("grade_pct", [-10.0, 8.0])
def test_downhill_has_positive_pitch_and_height_follows_it(scenario: DriftScenario, grade_pct: float) -> None:
    drift = replace(COARSE, pieces=((200.0, 0.0, grade_pct),), floor_undulation_m=0.0, floor_roughness_m=0.0)
    world = DriftWorld(replace(scenario, drift=drift, drive=replace(SHORT, vibration_deg=0.0, wander_m=0.0)))
    rows = world.history.rows
    assert rows[:, 4] == pytest.approx(-math.atan(grade_pct / 100.0), abs=1e-6)
    climbed = rows[-1, 2] - rows[0, 2]
    assert climbed == pytest.approx(25.0 * math.sin(math.atan(grade_pct / 100.0)), abs=1e-3)
    assert world.distance_m == pytest.approx(25.0, abs=0.01)


def test_no_axle_slips_sideways(world: DriftWorld) -> None:
    table = world.history.rows
    rear = np.array([(T @ T_base_rear(bend, world.machine))[:3, 3] for T, bend in poses(world, every=10)])
    front_heading = table[::10, 5]
    for places, heading in ((table[::10, :3], front_heading), (rear, front_heading - table[::10, 6])):
        step = np.gradient(places, axis=0) * TABLE_RATE_HZ / 10
        lateral = -step[:, 0] * np.sin(heading) + step[:, 1] * np.cos(heading)
        assert np.abs(lateral).max() < 0.01
        assert np.abs(lateral).mean() < 0.002  # roll and pitch show in the plan: the second order


def test_speed_is_that_of_the_front_axle_over_the_floor(world: DriftWorld) -> None:
    rows = world.history.rows
    moved = np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1) * TABLE_RATE_HZ
    assert moved == pytest.approx(np.abs(rows[1:, Column.SPEED]), abs=0.02)
    assert rows[:, Column.SPEED].max() * 3.6 == pytest.approx(12.0, rel=0.08)


def test_stops_and_reversals_happen_where_asked() -> None:
    settings = DriveSettings(distance_m=40.0, speed_kmh=10.0, stops=((10.0, 3.0),), reversals=((25.0, 8.0),))
    times = timetable(settings, np.random.default_rng(0))
    time_s = np.arange(0.0, times.duration_s, 0.01)
    way_m, speed_mps = times.at(time_s)
    assert way_m[0] == 0.0
    assert way_m[-1] == pytest.approx(40.0)
    at_rest = (np.abs(speed_mps) < 1e-9) & (np.abs(way_m - 10.0) < 1e-6)
    assert at_rest.sum() * 0.01 == pytest.approx(3.0, abs=0.05)
    back = way_m[speed_mps < -0.01]
    assert back.max() == pytest.approx(25.0, abs=0.01)
    assert back.min() == pytest.approx(17.0, abs=0.01)
    assert np.abs(speed_mps).sum() * 0.01 == pytest.approx(56.0, abs=0.05)
    assert np.gradient(way_m, 0.01) == pytest.approx(speed_mps, abs=0.01)
    assert np.abs(np.gradient(speed_mps, 0.01)).max() < 0.65


def test_too_tight_bends_are_refused(scenario: DriftScenario) -> None:
    from lhdmap.errors import ConfigError

    drift = replace(COARSE, pieces=((20.0, 0.0, 0.0), (10.0, 4.0, 0.0)))
    with pytest.raises(ConfigError, match="articulation"):
        DriftWorld(replace(scenario, drift=drift))


def test_speed_and_joint_give_the_heading_by_equation_1(world: DriftWorld) -> None:
    rows = world.history.rows
    steps = rows[::5, [Column.SPEED, Column.ARTICULATION, Column.ARTICULATION_RATE]].tolist()
    turned = sum(heading_rate(speed, bend, rate, world.machine) for speed, bend, rate in steps)
    assert turned * 5 / TABLE_RATE_HZ == pytest.approx(rows[-1, 5] - rows[0, 5], abs=math.radians(0.5))
    assert np.ptp(rows[:, 5]) > 0.3


@pytest.mark.parametrize("grade_pct", [-10.0, 8.0])
def test_the_wheels_give_what_speeding_up_climbing_and_rolling_ask_for(
    scenario: DriftScenario, grade_pct: float
) -> None:
    """Their work is the gain of height and what rolling takes, from rest to rest; at rest the brakes hold."""
    drift = replace(COARSE, pieces=((200.0, 0.0, grade_pct),), floor_undulation_m=0.0, floor_roughness_m=0.0)
    world = DriftWorld(replace(scenario, drift=drift, drive=replace(SHORT, vibration_deg=0.0, wander_m=0.0)))
    rows = world.history.rows
    speed, traction = rows[:, Column.SPEED], rows[:, Column.TRACTION]
    work = (traction * speed).sum() / TABLE_RATE_HZ
    climbed = 9.81 * (rows[-1, Column.Z] - rows[0, Column.Z])
    assert work == pytest.approx(climbed + 0.3 * world.distance_m, abs=0.05)
    assert (traction[speed == 0.0] == 0.0).all()


def test_the_wheels_slip_in_bursts_of_two_seconds() -> None:
    settings = WheelSettings(slip=True, slip_size=0.5)
    factors = slip_factors(settings, np.arange(60_000) / TABLE_RATE_HZ, np.random.default_rng(8))
    slipping = factors > 1.25
    lengths = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], slipping, [0]]))))[::2] / TABLE_RATE_HZ
    assert len(lengths) >= 2
    assert lengths[:-1] == pytest.approx(2.0, abs=0.002)
    assert set(factors.tolist()) == {1.0, 1.5}


def test_a_slipping_drive_has_wheels_faster_than_the_machine(scenario: DriftScenario) -> None:
    rows = DriftWorld(replace(scenario, wheels=WheelSettings(slip=True, slip_size=0.5))).history.rows
    moving = np.abs(rows[:, Column.SPEED]) > 0.1
    share = rows[moving, Column.WHEEL_SPEED] / rows[moving, Column.SPEED]
    assert sorted({round(one, 6) for one in share.tolist()}) == [1.0, 1.5]
