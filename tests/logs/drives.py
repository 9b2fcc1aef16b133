"""A short planar drive with walls that tell, written with the faults that drivers and clocks have."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import FloatArray, LaserScan, Message, Mount
from lhdmap.simulation.planar import PlanarScanner, drift_world, drive_along, simulate_scans

RATE_HZ, SPEED_MPS = 12.5, 2.0
START_NS, PERIOD_NS, LATE_NS = 1_700_000_000 * 10**9, 80_000_000, 4_000_000
FRONT = "/lidar/front/scan"
SCANS = 150


@functools.cache
def drive() -> tuple[FloatArray, tuple[LaserScan, ...]]:
    """Return true poses (N, 3) and scans of a drive at constant speed."""
    world = drift_world(5, rms_m=0.12, pieces=((45.0, 0.0),), cross_drift_at_m=None)
    poses = drive_along(world.centre_line_m, SPEED_MPS, RATE_HZ)[:SCANS]
    made = simulate_scans(world, poses, PlanarScanner(), RATE_HZ, 1)
    return poses, tuple(
        scan._replace(stamp_ns=START_NS + k * PERIOD_NS, frame_id="laser") for k, scan in enumerate(made)
    )


def write(
    path: Path,
    change: Callable[[int, LaserScan], LaserScan] = lambda _, scan: scan,
    log_ns: Callable[[int], int] = lambda k: START_NS + k * PERIOD_NS + LATE_NS,
    others: Callable[[int], list[tuple[str, Message]]] = lambda _: [],
    mounts: list[Mount] | None = None,
    scans: int = SCANS,
) -> Path:
    """Write the drive: `change` of each scan, its log time, and other messages written before it."""
    with LogWriter(path) as writer:
        if mounts is not None:
            writer.write("/tf_static", mounts, log_ns(0))
        for k, scan in enumerate(drive()[1][:scans]):
            for topic, message in others(k):
                writer.write(topic, message, log_ns(k))
            writer.write(FRONT, change(k, scan), log_ns(k))
    return path


def along_error_m(positions_m: FloatArray) -> float:
    """Return the largest distance (m) of planar positions (N, 3) from the true ones, both from the first pose on."""
    poses = drive()[0]
    c, s = np.cos(poses[0, 2]), np.sin(poses[0, 2])
    truth = (poses[:, :2] - poses[0, :2]) @ np.array([[c, -s], [s, c]])
    return float(np.hypot(*(positions_m[:, :2] - positions_m[0, :2] - truth).T).max())
