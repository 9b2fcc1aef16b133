"""Scans whose driver states them wrongly, put right: millimetres, degrees, limits that are none, two scanners on one topic."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lhdmap.messages import LaserScan

Stream = tuple[str, float, float]
"""What tells scanners on one topic apart: frame, angles of the first and the last beam (rad, rounded)."""


def stream_of(scan: LaserScan) -> Stream:
    """Return which scanner of its topic a scan is of."""
    end_rad = scan.angle_min_rad + scan.angle_increment_rad * (len(scan.ranges_m) - 1)
    return scan.frame_id, round(scan.angle_min_rad, 2), round(end_rad, 2)


@dataclass(frozen=True, slots=True)
class ScanRepair:
    """What is done to the scans of one topic.

    `range_scale`, `limit_scale`: to metres; `degrees`: start and increment are degrees; `start_degrees`: the start alone is;
    `streams`: those that are used, where several scanners share the topic.
    """

    range_scale: float = 1.0
    limit_scale: float = 1.0
    degrees: bool = False
    start_degrees: bool = False
    streams: frozenset[Stream] | None = None

    def applied(self, scan: LaserScan) -> LaserScan | None:
        """Return the scan as it was meant; None for one of a scanner that is not used."""
        if self.streams is not None and stream_of(scan) not in self.streams:
            return None
        low, high = scan.range_min_m * self.limit_scale, scan.range_max_m * self.limit_scale
        to_rad = math.radians(1.0)
        return scan._replace(
            angle_min_rad=scan.angle_min_rad * (to_rad if self.degrees or self.start_degrees else 1.0),
            angle_increment_rad=scan.angle_increment_rad * (to_rad if self.degrees else 1.0),
            range_min_m=0.0 if math.isnan(low) else low,
            range_max_m=math.inf if math.isnan(high) or (high == 0.0 and low == 0.0) else high,
            ranges_m=scan.ranges_m if self.range_scale == 1.0 else scan.ranges_m * np.float32(self.range_scale),
        )


AS_IT_IS = ScanRepair()
