"""Front scans on their way to the pile stage: hits in the map, the machine's own bodies and the sweep undone."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, Protocol

import numba as nb

from lhdmap.config import Settings
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.pile.face import FaceRegistration
from lhdmap.pile.figure9.stage import Figure9Stage
from lhdmap.pile.result import PileReport
from lhdmap.pile.stage import PileStage, ScanHits
from lhdmap.scan_matching.scan_points import planar_points

OFF = "no pile was looked for: pile.method is off"
NO_FRONT = (
    "no pile was looked for: there is no front scanner in the log; lhdmap pile looks in the cloud of a 3D scanner"
)
NO_SCAN = "no pile was looked for: no scan of the front scanner has a pose"
NO_INCLINOMETER = "no pile was looked for: there is no inclinometer in the log"


class PlacedScan(NamedTuple):
    """A front scan and where it was taken.

    `T_level_sensor` (4, 4): sensor in the level frame of `base_link`; `velocity` (3,): forward, lateral, turning speed, which
    undoes the sweep; `boxes_m` (K, 6): own bodies in the level frame; `pose` (4,): x, y, z (m), heading (rad) of `base_link`
    in the map.
    """

    scan: LaserScan
    T_level_sensor: FloatArray
    velocity: FloatArray
    boxes_m: FloatArray
    pose: FloatArray

    def hits(self) -> ScanHits:
        """Return the scan as hits in the map."""
        points = planar_points(self.scan, self.T_level_sensor, self.velocity, boxes_m=self.boxes_m)
        _place(points, self.pose)
        return ScanHits(self.scan.stamp_ns, points, self.pose)


class PileSink(Protocol):
    """What looks for the pile: in this process (`PileWatch`), or in one beside it."""

    def update(self, scan: PlacedScan) -> None:
        """Take one scan."""
        ...

    def report(self) -> PileReport:
        """Return what is said of the pile so far."""
        ...


class PileWatch:
    """The stage of `pile.method` on placed scans; `registration`: how far poses may be wrong, if not as set."""

    def __init__(self, settings: Settings, registration: FaceRegistration | None = None) -> None:
        self._method = settings.pile.method
        self._stage = _stage(settings, registration)

    def update(self, scan: PlacedScan) -> None:
        """Take one scan."""
        if self._stage is not None:
            self._stage.update(scan.hits())

    def report(self) -> PileReport:
        """Return what is said of the pile so far."""
        if self._stage is None:
            return PileReport(None, None, method=self._method, reason=OFF)
        report = self._stage.report()
        return report if report.history or report.piles else replace(report, reason=NO_SCAN)


@nb.njit(cache=True, nogil=True)
def _place(points, pose):  # type: ignore[no-untyped-def]
    """Move points (N, 3) from the level frame of `base_link` into the map, in place."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        points[i, 0], points[i, 1] = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        points[i, 2] += pose[2]


def _stage(settings: Settings, registration: FaceRegistration | None) -> PileStage | Figure9Stage | None:
    match settings.pile.method:
        case "off":
            return None
        case "figure9":
            return Figure9Stage(settings.pile, settings.figure9)
        case "figure9_repaired":
            return Figure9Stage(settings.pile, settings.figure9_repaired)
    return PileStage(settings.pile, registration)
