"""Wheel odometry whose driver repeats the last pose while the machine drives, then makes up for all of it at once."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from lhdmap.geometry import se2
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.steps import WheelStep
from lhdmap.odometry.wheels.stale import StaleWheels
from lhdmap.simulation.planar import PlanarScanner, simulate_scans

from tests.odometry.planar_drives import LEVEL, along, world

RATE_HZ = 5.0
DRIVES, TURNS, RESTS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.5]), np.zeros(3)


def step(forward_m: float, turn_rad: float | None = 0.0) -> WheelStep:
    return WheelStep(forward_m, 0.01, turn_rad, 0.01)


def test_a_repeated_pose_and_the_leap_after_it_are_not_believed() -> None:
    wheels = StaleWheels()
    told = [0.2, 0.2, 0.0, 0.0, 0.6, 0.2]
    assert [wheels.believes(step(way), DRIVES, 0.2) for way in told] == [True, True, False, False, False, True]
    assert wheels.steps == 3


def test_a_machine_that_rests_and_starts_is_believed() -> None:
    wheels = StaleWheels()
    assert all(wheels.believes(step(way), RESTS, 0.2) for way in (0.0, 0.0, 0.05, 0.2))
    assert wheels.believes(step(0.0, None), RESTS, 0.2)
    assert not wheels.believes(step(0.0), TURNS, 0.2)


def test_wheels_that_go_on_standing_are_believed_in_the_end() -> None:
    """Where smooth walls do not hold the scans, the wheels' standstill is all there is."""
    wheels = StaleWheels()
    believed = [wheels.believes(step(0.0), DRIVES, 0.2) for _ in range(8)]
    assert not any(believed[:4])
    assert any(believed[4:6])


def test_a_drive_with_wheels_that_hang() -> None:
    poses = along(np.full(400, 1.0), start=200)[:: round(25.0 / RATE_HZ)]
    scans = simulate_scans(world(), poses, PlanarScanner(), RATE_HZ, 3)
    told = poses.copy()
    for first in (20, 45, 60):  # in the straight and in the bend
        told[first : first + 4] = told[first - 1]
    odometry = PlanarOdometry(OdometrySettings())
    found = [odometry.update(scans[0], LEVEL, None)]
    for scan, (before, after) in zip(scans[1:], pairwise(told), strict=True):
        moved = se2.between(before, after)
        sigma = 0.003 + 0.07 * abs(moved[0]), 0.003 + 0.3 * abs(moved[2])
        found.append(odometry.update(scan, LEVEL, WheelStep(float(moved[0]), sigma[0], float(moved[2]), sigma[1])))
    off = np.array(
        [
            se2.between(se2.between(poses[0], pose), se2.between(found[0].pose_odom_base, one.pose_odom_base))
            for pose, one in zip(poses, found, strict=True)
        ]
    )
    assert not any(one.lost for one in found)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.05
    assert np.abs(off[:, 2]).max() < math.radians(0.5)
    assert odometry.wheels.stale.steps == 15
