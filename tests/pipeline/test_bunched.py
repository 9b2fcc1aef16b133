"""Old loggers stamp what they deliver: a pause of two seconds, then ten scans at once, each with its wheel pose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.messages import LaserScan, WheelPose
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.simulation.planar import PlanarScanner, simulate_scans, world_from_polylines

PERIOD_S, SCANS, WAY_M = 0.2, 400, 0.05
LEARNING_SCANS = 60  # until the stamps are known for what they are


def delivered_s(k: int) -> float:
    """Return when a scan was delivered: of twenty, the first eleven wait for 2.2 s and come within 11 ms; some run backwards."""
    first, place = divmod(k, 20)
    start_s = 20 * first * PERIOD_S
    if place < 11:
        return start_s + 11 * PERIOD_S + 0.001 * place
    return start_s + (place + 1) * PERIOD_S - (0.3 if place == 15 else 0.0)


def blind(stamp_ns: int) -> LaserScan:
    """Return a scan without returns: the wheels alone carry the pose."""
    return LaserScan(
        stamp_ns, "front", -math.pi / 2, math.pi / 180, 0.0, 0.1, 30.0, np.full(181, math.inf, dtype=np.float32)
    )


@pytest.mark.parametrize("turn_rad", [0.0, 0.01])
def test_bunches_and_gaps_lose_nothing_of_the_wheels_way(turn_rad: float) -> None:
    pipeline = MappingPipeline(Settings(), None, MappingOptions(cloud=False))
    x = y = heading = 0.0
    for k in range(SCANS):
        stamp_ns = round(1e9 * (100.0 + delivered_s(k)))
        pipeline.update("front", blind(stamp_ns))
        pipeline.update("wheel_odometry", WheelPose(stamp_ns, x, y, heading))
        x, y = x + WAY_M * math.cos(heading), y + WAY_M * math.sin(heading)
        heading += turn_rad
    pipeline.finish()
    poses = pipeline.track.rows().poses[LEARNING_SCANS:]
    steps = len(poses) - 1
    assert steps > 300
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() == pytest.approx(WAY_M * steps, rel=0.01)
    assert poses[-1, 5] - poses[0, 5] == pytest.approx(turn_rad * steps, rel=0.02, abs=0.01)


def test_a_log_that_begins_in_bunches_while_the_robot_turns() -> None:
    """A cut of a log: its first scans come three at once, 0.6 s apart, and the robot turns by 40 degrees a second all the time."""
    room = world_from_polylines(
        [np.array([[-4.0, -3.0], [5.0, -3.0], [5.0, 2.0], [1.0, 2.5], [-4.0, 4.0], [-4.0, -3.0]])],
        np.zeros((2, 3)),
    )
    turn_rad = 40.0 / 180.0 * math.pi * PERIOD_S
    poses = np.column_stack([np.zeros((40, 2)), turn_rad * np.arange(40)])
    scans = simulate_scans(room, poses, PlanarScanner(), 1.0 / PERIOD_S, 1)
    pipeline = MappingPipeline(Settings(), None, MappingOptions(cloud=False))
    for k, scan in enumerate(scans):
        stamp_ns = round(1e9 * (100.0 + 3 * PERIOD_S * (k // 3 + 1) + 0.001 * (k % 3)))
        pipeline.update("front", scan._replace(stamp_ns=stamp_ns))
        pipeline.update("wheel_odometry", WheelPose(stamp_ns, *poses[k].tolist()))
    pipeline.finish()
    told = pipeline.track.rows().poses
    assert len(told) == len(poses)
    assert np.hypot(*(told[:, :2] - told[0, :2]).T).max() < 0.1
    assert np.unwrap(told[:, 5])[-1] - told[0, 5] == pytest.approx(poses[-1, 2], abs=0.05)
