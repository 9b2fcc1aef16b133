"""Short planar drives with truth, and the planar odometry run over them as the pipeline does."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from lhdmap.evaluation.planar_segments import SegmentErrors, planar_segments
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.start import ScanInput, starting_velocity
from lhdmap.odometry.steps import OdometryStep
from lhdmap.simulation.planar import PlanarScanner, PlanarWorld, drift_world, drive_along, simulate_scans

LEVEL = np.eye(4)
RATE_HZ = 25.0
ROUGH_M, SMOOTH_M = 0.12, 0.005
PIECES = ((20.0, 0.0), (12.0 * math.pi / 6, math.pi / 6), (14.0, 0.0))
WARM_SCANS = 50


class Driven(NamedTuple):
    """Estimated and true poses (N, 3), both from the first scan's pose on, and the odometry's steps."""

    estimate: FloatArray
    truth: FloatArray
    steps: list[OdometryStep]

    @property
    def errors(self) -> FloatArray:
        """Error of each pose in the true one's axes, shape (N, 3)."""
        return np.array([se2.between(a, b) for a, b in zip(self.truth, self.estimate, strict=True)])

    @property
    def distance_m(self) -> FloatArray:
        return np.hypot(self.errors[:, 0], self.errors[:, 1])

    def segments(self, length_m: float = 10.0) -> SegmentErrors:
        return planar_segments(self.estimate, self.truth, length_m)


@functools.lru_cache(maxsize=4)
def world(seed: int = 11, rms_m: float = ROUGH_M) -> PlanarWorld:
    """Return a drift of 40 m with a bend; the machine drives 27 m of it."""
    return drift_world(seed, rms_m=rms_m, pieces=PIECES, cross_drift_at_m=None)


@functools.lru_cache(maxsize=4)
def drive(speed_mps: float = 3.3, seed: int = 11, rms_m: float = ROUGH_M) -> tuple[FloatArray, tuple[LaserScan, ...]]:
    """Return true poses and scans at 25 Hz of a drive at constant speed."""
    poses = drive_along(world(seed, rms_m).centre_line_m, speed_mps, RATE_HZ)
    return poses, scans_at(poses, seed, rms_m)


def scans_at(poses: FloatArray, seed: int = 11, rms_m: float = ROUGH_M) -> tuple[LaserScan, ...]:
    return tuple(simulate_scans(world(seed, rms_m), poses, PlanarScanner(), RATE_HZ, seed))


def along(speeds_mps: FloatArray, start: int = 0) -> FloatArray:
    """Return poses along the drift's middle whose speed at each scan is given; negative drives back."""
    fine = drive_along(world().centre_line_m, 0.01, 1.0)
    s = np.cumsum(speeds_mps) / RATE_HZ + 0.01 * start
    return np.column_stack([np.interp(s, 0.01 * np.arange(len(fine)), column) for column in fine.T])


def run(scans: tuple[LaserScan, ...], truth: FloatArray, method: str = "anchored") -> Driven:
    inputs = [ScanInput(scan, LEVEL) for scan in scans]

    def make(velocity: FloatArray | None) -> PlanarOdometry:
        return PlanarOdometry(OdometrySettings(method=method), velocity=velocity)

    odometry = make(starting_velocity(make, inputs[:WARM_SCANS]))
    steps = [odometry.update(*one) for one in inputs]
    move = se2.compose(truth[0], se2.inverse(steps[0].pose_odom_base))
    estimate = np.array([se2.compose(move, step.pose_odom_base) for step in steps])
    return Driven(estimate, truth, steps)
