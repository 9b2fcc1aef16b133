"""Front scans on their way to the pile stage: hits in the map, the machine's own bodies and the sweep undone."""

from __future__ import annotations

import math

import numba as nb

from lhdmap.config import Settings
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.scan_points import planar_points
from lhdmap.pile.face import Registration
from lhdmap.pile.figure9_stage import Figure9Stage
from lhdmap.pile.stage import PileStage, ScanHits


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
    _place(points, pose)
    return ScanHits(scan.stamp_ns, points, pose)


@nb.njit(cache=True, nogil=True)
def _place(points, pose):  # type: ignore[no-untyped-def]
    """Move points (N, 3) from the level frame of `base_link` into the map, in place."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        points[i, 0], points[i, 1] = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        points[i, 2] += pose[2]


def pile_stage(settings: Settings, registration: Registration | None = None) -> PileStage | Figure9Stage | None:
    """Return the stage of `pile.method`, None for `off`; `registration`: how far poses may be wrong, if not as set."""
    match settings.pile.method:
        case "off":
            return None
        case "figure9":
            return Figure9Stage(settings.pile, settings.figure9)
        case "figure9_repaired":
            return Figure9Stage(settings.pile, settings.figure9_repaired)
    return PileStage(settings.pile, registration)
