"""Tiny logs for the commands."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import LaserScan

START_NS = 1_700_000_000_000_000_000
HALF_LENGTH_M, HALF_WIDTH_M = 12.0, 3.0
BEAMS, FIRST_RAD = 181, -math.radians(90.0)
STEP_RAD = math.radians(1.0)


def room_ranges(x_m: float) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    """Ranges, shape (181,), from (x, 0) in a rectangular room with its middle at the origin, heading along x."""
    angles = FIRST_RAD + STEP_RAD * np.arange(BEAMS)
    with np.errstate(divide="ignore"):
        ahead = (HALF_LENGTH_M - x_m) / np.maximum(np.cos(angles), 1e-9)
        aside = HALF_WIDTH_M / np.maximum(np.abs(np.sin(angles)), 1e-9)
    return np.minimum(ahead, aside).astype(np.float32)


def write_room_log(path: Path, scans: int = 60, topics: tuple[str, ...] = ("/lidar/front/scan",)) -> Path:
    """Write a drive of 4 cm a scan, 25 scans a second, through the room, up to its last metre; 5 mm of noise."""
    rng = np.random.default_rng(3)
    with LogWriter(path) as writer:
        for i in range(scans):
            stamp = START_NS + i * 40_000_000
            noise = rng.normal(0.0, 0.005, BEAMS).astype(np.float32)
            ranges = room_ranges(min(0.04 * i - 6.0, HALF_LENGTH_M - 1.0)) + noise
            for topic in topics:
                scan = LaserScan(stamp, "laser", FIRST_RAD, STEP_RAD, 0.0, 0.1, 80.0, ranges)
                writer.write(topic, scan)
    return path
