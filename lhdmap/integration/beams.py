"""Beams of a 2D scanner: directions, validity and times."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray, LaserScan, PointCloud


class BeamTable(NamedTuple):
    """Directions of all beams in the scanner's frame: `cos` and `sin`, each of shape (N,), read-only."""

    cos: FloatArray
    sin: FloatArray


@lru_cache(maxsize=16)
def beam_table(angle_min_rad: float, angle_increment_rad: float, beams: int) -> BeamTable:
    """Return the directions of a scan's beams; the same object for the same scanner."""
    angles = angle_min_rad + angle_increment_rad * np.arange(beams)
    table = BeamTable(np.cos(angles), np.sin(angles))
    for array in table:
        array.flags.writeable = False
    return table


def table_of(scan: LaserScan) -> BeamTable:
    """Return the directions of the beams of `scan`."""
    return beam_table(scan.angle_min_rad, scan.angle_increment_rad, len(scan.ranges_m))


def valid_beams(scan: LaserScan) -> npt.NDArray[np.bool_]:
    """Return which beams have a return, shape (N,): finite and within the scanner's range limits."""
    ranges = scan.ranges_m
    with np.errstate(invalid="ignore"):
        return np.isfinite(ranges) & (ranges >= scan.range_min_m) & (ranges <= scan.range_max_m) & (ranges > 0.0)


def scan_points(scan: LaserScan) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return the valid points in the scanner's frame, shape (M, 3), metres, and their beams' indices, shape (M,)."""
    beams = np.flatnonzero(valid_beams(scan))
    table, ranges = table_of(scan), scan.ranges_m[beams].astype(np.float64)
    return np.stack([ranges * table.cos[beams], ranges * table.sin[beams], np.zeros(len(beams))], axis=-1), beams


def sweep_stamps_ns(message: LaserScan | PointCloud) -> tuple[int, int]:
    """Return the times at which the poses of a sweep are wanted.

    For a scan the times of its first and last beam (in the order of the array, so the second is earlier where the time
    increment is negative), for a cloud its earliest and latest point.
    """
    if isinstance(message, LaserScan):
        last_s = message.time_increment_s * max(len(message.ranges_m) - 1, 0)
        return message.stamp_ns, message.stamp_ns + round(last_s * 1e9)
    if len(message.time_offsets_s) == 0:
        return message.stamp_ns, message.stamp_ns
    first_s, last_s = float(message.time_offsets_s.min()), float(message.time_offsets_s.max())
    return message.stamp_ns + round(first_s * 1e9), message.stamp_ns + round(last_s * 1e9)
