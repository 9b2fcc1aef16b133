"""Front scans on their way to the pile stage: hits in the map, the machine's own bodies and the sweep undone."""

from __future__ import annotations

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.scan_points import planar_points
from lhdmap.pile.stage import ScanHits


def scan_hits(
    scan: LaserScan, T_level_sensor: FloatArray, velocity: FloatArray, boxes_m: FloatArray, pose: FloatArray
) -> ScanHits:
    """Return a scan as hits in the map.

    Args:
        scan: the scan.
        T_level_sensor: pose (4, 4) of the sensor in the level frame of `base_link`.
        velocity: forward, lateral, turning speed (3,), which undoes the sweep.
        boxes_m: own bodies (K, 6) in the level frame.
        pose: x, y, z (m), heading (rad) of `base_link` in the map, shape (4,).
    """
    points = planar_points(scan, T_level_sensor, velocity, boxes_m=boxes_m)
    hits = se2.transform(np.array([pose[0], pose[1], pose[3]]), points)
    hits[:, 2] = points[:, 2] + pose[2]
    return ScanHits(scan.stamp_ns, hits, pose)
