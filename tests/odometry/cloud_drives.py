"""Simulated drives with a spinning 3D scanner, and a stage run over them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray, PointCloud
from lhdmap.odometry.cloud.motion import CloudPrior
from lhdmap.odometry.cloud.odometry import CloudOdometry
from lhdmap.odometry.cloud.steps import CloudStep
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings
from lhdmap.simulation.world import DriftWorld

RINGS, TURN, HALF_VIEW_DEG = 32, 450, 22.0
PERIOD_S, NOISE_M = 0.1, 0.01
T_BASE_SENSOR = se3.from_rpy(0.02, 0.05, 0.1, (0.5, 0.1, 2.0))
_PARTS = 50  # of a turn that share a pose
NO_TIMES = np.zeros(0, dtype=np.float32)


class CloudDrive(NamedTuple):
    """Clouds of a drive, each point with its time, and the true pose (N, 4, 4) of `base_link` at the stamps."""

    clouds: list[PointCloud]
    T_map_base: FloatArray

    def part(self, *ranges: range) -> CloudDrive:
        """Return some of the clouds, in order."""
        picked = [i for part in ranges for i in part]
        return CloudDrive([self.clouds[i] for i in picked], self.T_map_base[picked])

    @property
    def way_m(self) -> float:
        return float(np.linalg.norm(np.diff(self.T_map_base[:, :3, 3], axis=0), axis=1).sum())


def simulate(world: DriftWorld, reach_m: float, *, count: int) -> CloudDrive:
    """Return the first `count` clouds of the drive in `world` by a scanner with a reach and a noise of 1 cm."""
    rng = np.random.default_rng(world.scenario.seed)
    starts_s = PERIOD_S * np.arange(count, dtype=np.float64)
    assert starts_s[-1] + PERIOD_S < world.history.last_s
    clouds = [_cloud(world, float(start_s), reach_m, rng) for start_s in starts_s]
    return CloudDrive(clouds, _poses(world, starts_s))


def drift_world(seed: int, drift: DriftSettings, speed_kmh: float, standstill_s: float = 0.3) -> DriftWorld:
    drive = DriveSettings(distance_m=30.0, speed_kmh=speed_kmh, standstill_s=standstill_s)
    return DriftWorld(DriftScenario(seed=seed, drift=drift, drive=drive, scanner=ScannerSettings(max_range_m=30.0)))


def _poses(world: DriftWorld, time_s: FloatArray) -> FloatArray:
    return np.array(
        [se3.from_rpy(row[3], row[4], row[5], (row[0], row[1], row[2])) for row in world.history.at(time_s).tolist()]
    )


def _cloud(world: DriftWorld, start_s: float, reach_m: float, rng: np.random.Generator) -> PointCloud:
    share = np.repeat(np.arange(TURN) / TURN, RINGS)
    azimuth, rise = 2.0 * np.pi * share, np.tile(np.radians(np.linspace(-HALF_VIEW_DEG, HALF_VIEW_DEG, RINGS)), TURN)
    beams = np.stack([np.cos(rise) * np.cos(azimuth), np.cos(rise) * np.sin(azimuth), np.sin(rise)], axis=1)
    part = (share * _PARTS).astype(np.int64)
    times_s = PERIOD_S * (np.arange(_PARTS) + 0.5) / _PARTS
    T_map_sensor = (_poses(world, start_s + times_s) @ T_BASE_SENSOR)[part]
    surface = world.near(world.history.at(np.array([start_s]))[0, :3])
    directions = np.einsum("nij,nj->ni", T_map_sensor[:, :3, :3], beams)
    rays = np.concatenate([T_map_sensor[:, :3, 3] - surface.origin_m, directions], axis=1)
    ranges = surface.cast(rays.astype(np.float32)) + NOISE_M * rng.standard_normal(len(rays))
    hit = ranges < reach_m
    points = (beams[hit] * ranges[hit, None]).astype(np.float32)
    return PointCloud(START_NS + round(start_s * 1e9), "lidar", points, times_s[part][hit].astype(np.float32))


def wheels_of(drive: CloudDrive, scale: float) -> list[CloudPrior | None]:
    """Return the wheels' motion between the clouds, its distance off by a factor."""
    steps = np.linalg.inv(drive.T_map_base[:-1]) @ drive.T_map_base[1:]
    priors: list[CloudPrior | None] = [None]
    for step in steps:
        planar = se3.from_rpy(0.0, 0.0, se3.to_rpy(step)[2], (scale * float(step[0, 3]), float(step[1, 3]), 0.0))
        priors.append(CloudPrior(planar, np.diag([0.005, 0.005, 0.002]) ** 2))
    return priors


def run(stage: CloudOdometry, drive: CloudDrive, priors: list[CloudPrior | None] | None = None) -> list[CloudStep]:
    """Return the steps of the stage over the drive, with the true roll and pitch as the inclinometer's."""
    steps = []
    for index, cloud in enumerate(drive.clouds):
        roll, pitch, _ = se3.to_rpy(drive.T_map_base[index])
        prior = priors[index] if priors is not None else None
        steps.append(stage.update(cloud, T_BASE_SENSOR, prior, se3.from_rpy(roll, pitch, 0.0)))
    return steps


def errors(steps: list[CloudStep], drive: CloudDrive) -> FloatArray:
    """Return the error (N, 4, 4) of each pose relative to the first."""
    estimate = np.array([step.T_odom_base for step in steps])
    truth = se3.inverse(drive.T_map_base[0]) @ drive.T_map_base
    return np.linalg.inv(truth) @ se3.inverse(estimate[0]) @ estimate


def step_errors(steps: list[CloudStep], drive: CloudDrive) -> FloatArray:
    """Return the error (N - 1, 4, 4) of each pose relative to the one before."""
    estimate = np.array([step.T_odom_base for step in steps])
    truth = drive.T_map_base
    moved = np.linalg.inv(truth[:-1]) @ truth[1:]
    return np.linalg.inv(moved) @ np.linalg.inv(estimate[:-1]) @ estimate[1:]
