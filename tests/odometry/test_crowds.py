"""A slow scanner among people, with wheels: what the wheels predict is not given up for a chance match."""

from __future__ import annotations

import functools
from itertools import pairwise

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.steps import OdometryStep, WheelStep
from lhdmap.simulation.planar import PlanarScanner, simulate_scans

from tests.odometry.planar_drives import LEVEL, along, world

RATE_HZ, SPEED_MPS, SCANS = 1.6, 0.5, 60


@functools.lru_cache(maxsize=1)
def drive() -> tuple[FloatArray, list[LaserScan]]:
    """Return true poses and scans, 0.3 m apart, through a bend."""
    poses = along(np.full(SCANS * 20, SPEED_MPS), start=1200)[:: round(25.0 / RATE_HZ)][:SCANS]
    return poses, simulate_scans(world(), poses, PlanarScanner(), RATE_HZ, 5)


def wheels(poses: FloatArray, rng: np.random.Generator) -> list[WheelStep | None]:
    """Return the wheels' steps, 2 % off."""
    found: list[WheelStep | None] = [None]
    for before, after in pairwise(poses):
        moved = se2.between(before, after) * (1.0 + 0.02 * rng.standard_normal(3))
        found.append(WheelStep(float(moved[0]), 0.02, float(moved[2]), 0.03))
    return found


def crowded(scan: LaserScan, rng: np.random.Generator, share: float) -> LaserScan:
    """Return the scan with people before that share of the beams: arcs of 0.4 m, 0.8 to 3 m away."""
    ranges = scan.ranges_m.copy()
    hidden = 0
    while hidden < share * ranges.size:
        away = rng.uniform(0.8, 3.0)
        width = round(0.4 / away / scan.angle_increment_rad)
        first = rng.integers(0, ranges.size)
        ranges[first : first + width] = away + 0.02 * rng.standard_normal(len(ranges[first : first + width]))
        hidden = int(np.count_nonzero(ranges != scan.ranges_m))
    return scan._replace(ranges_m=ranges)


def run(scans: list[LaserScan], steps: list[WheelStep | None]) -> list[OdometryStep]:
    odometry = PlanarOdometry(OdometrySettings())
    return [odometry.update(scan, LEVEL, step) for scan, step in zip(scans, steps, strict=True)]


def errors(found: list[OdometryStep], poses: FloatArray) -> FloatArray:
    """Return the error of each pose relative to the first, shape (N, 3)."""
    own = [se2.between(found[0].pose_odom_base, step.pose_odom_base) for step in found]
    true = [se2.between(poses[0], pose) for pose in poses]
    return np.array([se2.between(a, b) for a, b in zip(true, own, strict=True)])


def test_slow_scans_and_wheels_agree() -> None:
    poses, scans = drive()
    found = run(scans, wheels(poses, np.random.default_rng(1)))
    off = errors(found, poses)
    assert not any(step.lost for step in found)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.1
    assert np.abs(off[:, 2]).max() < np.radians(1.0)


def test_a_crowd_does_not_carry_the_pose_away() -> None:
    """Three quarters of the beams hidden over 9 m, other people in each scan: without the wheels' word it ended 6 to 10 m off."""
    poses, scans = drive()
    ends, turns = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        mixed = [crowded(scan, rng, 0.75) if 15 <= k < 45 else scan for k, scan in enumerate(scans)]
        off = errors(run(mixed, wheels(poses, rng)), poses)
        ends.append(np.hypot(off[:, 0], off[:, 1]).max())
        turns.append(np.abs(off[:, 2]).max())
    assert np.median(ends) < 0.3
    assert max(ends) < 0.6
    assert max(turns) < np.radians(12.0)
