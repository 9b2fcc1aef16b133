"""A tunnel drive made of formulas: rough walls, floor and roof, a bend, a ramp, a smooth stretch, wheel slip."""

from __future__ import annotations

import numpy as np
from lhdmap.evaluation.trajectory import evaluate_trajectory
from lhdmap.geometry.se3 import quaternions_from_rpy
from lhdmap.integration.cloud import GridCloud
from lhdmap.mapfolder import Diagnostics
from lhdmap.report.data import AngleSeries, ReportData, SpeedSeries, Summary, TopicRow
from lhdmap.trajectory import Trajectory

START_NS = 1_700_000_000_000_000_000
HALF_WIDTH_M, HEIGHT_M = 2.0, 3.6


def drive(scans: int = 9000, speed_mps: float = 2.0, scale: float = 1.0, heading_drift: float = 0.0) -> Trajectory:
    """Return a drive of `scans` poses at 50 Hz: straight, a bend of 90 degrees, a ramp of 5 %; `scale` stretches it."""
    s = np.arange(scans) * speed_mps / 50.0
    length = s[-1] if scans > 1 else 1.0
    heading = np.pi / 2 / (1 + np.exp(-(s - 0.4 * length) / (0.03 * length))) + heading_drift * s
    ramp = 0.05 / (1 + np.exp(-(s - 0.7 * length) / (0.02 * length)))
    step = scale * np.diff(s, prepend=0.0)
    positions = np.cumsum(np.column_stack([np.cos(heading), np.sin(heading), ramp]) * step[:, None], axis=0)
    quaternions = quaternions_from_rpy(0.005 * np.sin(s), -ramp, heading)
    stamps = START_NS + np.arange(scans, dtype=np.int64) * 20_000_000
    return Trajectory(stamps, positions, quaternions)


def tunnel_cloud(path: Trajectory, points: int, seed: int = 0) -> GridCloud:
    """Return points on walls, floor and roof of a tunnel round the path, with normals and curvature."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(0, len(path.stamps_ns), points)
    ahead = np.gradient(path.positions_m, axis=0)[rows]
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.linalg.norm(ahead[:, :2], axis=1, keepdims=True)
    side = rng.choice(4, points)
    across = np.where(
        side < 2, np.where(side == 0, 1, -1) * HALF_WIDTH_M, rng.uniform(-HALF_WIDTH_M, HALF_WIDTH_M, points)
    )
    up = np.select([side < 2, side == 2], [rng.uniform(0, HEIGHT_M, points), np.zeros(points)], HEIGHT_M)
    rough = 0.15 * np.sin(rows / 90.0) + rng.normal(0, 0.05, points)
    xy = path.positions_m[rows, :2] + left * (across + np.sign(across) * rough)[:, None]
    cloud = np.column_stack([xy, path.positions_m[rows, 2] + up + 0.3 * rough]).astype(np.float32)
    return GridCloud(cloud, np.zeros_like(cloud), np.zeros(points, np.float32), path.stamps_ns[rows])


def diagnostics(path: Trajectory, seed: int = 0) -> Diagnostics:
    """Return diagnostics of each fourth scan; along the smooth stretch from 50 to 62 % the along axis is weak."""
    rng = np.random.default_rng(seed)
    stamps = path.stamps_ns[::4]
    m = len(stamps)
    share = np.linspace(0, 1, m)
    weak = (share > 0.5) & (share < 0.62) | ((share > 0.8) & (share < 0.803))
    noise = np.exp(rng.normal(0, 0.3, (3, m)))
    slip = np.where((share > 0.3) & (share < 0.33), 0.35, 0.01) + rng.normal(0, 0.01, m)
    return Diagnostics(
        stamps, 0.01 * noise[0], np.full(m, 0.9), np.where(weak, 2e2, 4e5) * noise[0], 1e6 * noise[1], 5e6 * noise[2],
        weak, ["wheels" if flag else "" for flag in weak], slip, ["used"] * m,
    )  # fmt: skip


def report_data(scans: int = 9000, points: int = 500_000) -> ReportData:
    """Return a full report of the drive."""
    truth = drive(scans)
    final, odometry = drive(scans, scale=1.0005, heading_drift=2e-5), drive(scans, scale=1.003, heading_drift=2e-4)
    found = diagnostics(final)
    speed = 2.0 + 0.3 * np.sin(np.arange(scans) / 300.0)
    wheels = np.interp(final.stamps_ns, found.stamp_ns, np.nan_to_num(found.slip))
    return ReportData(
        title="Map of drive_north.mcap",
        summary=Summary(scans, scans // 4, scans / 50.0, scans / 25.0, 8.1, 22.0, 412.0, 0.12, 0, 0),
        topics=[
            TopicRow("/lidar/front/scan", "sensor_msgs/LaserScan", scans, 50.0, "front scanner"),
            TopicRow("/inclinometer", "sensor_msgs/Imu", 2 * scans, 100.0, "attitude"),
            TopicRow("/machine/tachometer", "geometry_msgs/TwistStamped", scans // 5, 10.0, "wheel speed; 2 gaps"),
        ],
        trajectory=final,
        odometry=odometry,
        evaluation=evaluate_trajectory(final, truth),
        cloud=tunnel_cloud(final, points),
        diagnostics=found,
        odometry_speed=SpeedSeries(final.stamps_ns, speed),
        tachometer_speed=SpeedSeries(final.stamps_ns, speed * (1 + wheels)),
        articulation=AngleSeries(final.stamps_ns[::5], 0.3 * np.sin(np.arange(len(final.stamps_ns[::5])) / 50.0)),
        warnings=["/lidar/front/scan: 3 scans came late", "no mounts in the log: a level scanner at base_link"],
        settings_text="[odometry]\n# Spacing of the compared scans. Unit: m.\nspacing_m = 0.5\n",
        provenance={"log": "drive_north.mcap, SHA-256 2cf24dba5fb0", "software": "lhdmap 0.1.0"},
    )  # fmt: skip
