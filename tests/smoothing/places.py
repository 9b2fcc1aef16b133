"""Key scans of simulated places, with the odometry's drift put on them."""

from __future__ import annotations

import functools
import math

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.step_error import StepError
from lhdmap.simulation.planar import PlanarScanner, PlanarWorld, drift_world, simulate_scans, world_from_polylines

SIDE_M = 16.0
# Of a metre: what the drifts of these tests are off.
SIGMA_M, SIGMA_RAD = 0.005, math.radians(0.03)
WALK = StepError(np.diag([SIGMA_M**2, SIGMA_M**2, SIGMA_RAD**2]), np.zeros(3), np.zeros((3, 3)))


@functools.lru_cache(maxsize=1)
def square() -> PlanarWorld:
    """Return a drift of 4 m width around a square pillar of 16 m, all walls rough, corners sharp."""
    rng = np.random.default_rng(8)
    walls = [_rough_square(half, rng) for half in (SIDE_M / 2 - 2.0, SIDE_M / 2 + 2.0)]
    return world_from_polylines(walls, np.zeros((1, 3)))


def _rough_square(half_m: float, rng: np.random.Generator) -> FloatArray:
    t = np.linspace(-half_m, half_m, 400)
    sides = []
    for turn in range(4):
        bump = np.interp(t, np.linspace(-half_m, half_m, 40), rng.normal(0.0, 0.12, 40)) * (np.abs(t) < half_m - 0.1)
        points = np.column_stack([t, -half_m + bump])
        c, s = math.cos(turn * math.pi / 2), math.sin(turn * math.pi / 2)
        sides.append(points @ np.array([[c, s], [-s, c]]))
    return np.concatenate([*sides, sides[0][:1]])


def lap(count: int) -> FloatArray:
    """Return poses (N, 3) each metre on the way around the square, a quarter turn at each corner."""
    half, poses = SIDE_M / 2, []
    for k in range(count):
        side, along = divmod(float(k), SIDE_M)
        turn = int(side) % 4 * math.pi / 2
        c, s = math.cos(turn), math.sin(turn)
        x, y = along - half, -half
        poses.append([c * x - s * y, s * x + c * y, turn])
    return np.array(poses)


def drifted(true: FloatArray, scale: float, turn_deg_per_m: float) -> FloatArray:
    """Return poses of an odometry that stretches each step and turns a little each metre."""
    poses = [true[0]]
    for k in range(1, len(true)):
        step = se2.between(true[k - 1], true[k])
        step = np.array([step[0] * scale, step[1] * scale, step[2] + math.radians(turn_deg_per_m)])
        poses.append(se2.compose(poses[-1], step))
    return np.array(poses)


def keys_of(world: PlanarWorld, true: FloatArray, odometry: FloatArray, reach_m: float = 80.0) -> list[KeyScan]:
    """Return key scans measured at the true poses and placed by the odometry; the scanner sees as far as `reach_m`."""
    scans = simulate_scans(world, true, PlanarScanner(field_of_view_deg=270.0, max_range_m=reach_m), 1.0, 3)
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(odometry[:, :2], axis=0).T))])
    keys = []
    for scan, pose, way in zip(scans, odometry, travelled, strict=True):
        points = planar_points(scan, np.eye(4), np.zeros(3)).astype(np.float32)
        keys.append(KeyScan(scan.stamp_ns, pose.copy(), float(way), points, WALK))
    return keys


def straight(count: int, rms_m: float) -> tuple[PlanarWorld, FloatArray]:
    """Return a straight drift and poses each metre in it."""
    world = drift_world(3, rms_m=rms_m, pieces=((count + 20.0, 0.0),), cross_drift_at_m=None)
    poses = np.zeros((count, 3))
    poses[:, 0] = 5.0 + np.arange(count)
    return world, poses
