"""Fig. 9 as a stage, beside `PileStage`: the cloud grows scan by scan, and the loop ends by the paper's conditions.

The paper's drives begin 50 m before the pile. Of longer ones, what is farther from the machine than `reach_m` is let go, so
that an estimate costs the same however long the drive.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.pile.figure9.method import figure9, loop_ends
from lhdmap.pile.figure9.settings import Figure9Constants
from lhdmap.pile.result import PileApproach, PileReport, Snapshot
from lhdmap.pile.settings import PileSettings
from lhdmap.pile.stage import ScanHits

_CELL_M = 0.1  # finer than the method's own voxels
_SCANS_BETWEEN = 25


class Figure9Stage:
    """`update` with each scan until the loop of Fig. 9 ends; `report` at any time."""

    def __init__(self, settings: PileSettings, constants: Figure9Constants) -> None:
        self._settings, self._constants = settings, constants
        self._points = np.zeros((0, 3))
        self._fresh: list[FloatArray] = []
        self._position: FloatArray | None = None
        self._history: list[Snapshot] = []
        self._decision: Snapshot | None = None
        self._ended = False

    def update(self, scan: ScanHits) -> Snapshot | None:
        """Take one scan; return the new estimate where the machine has moved far enough for one."""
        if self._ended:
            return None
        self._fresh.append(scan.points_map)
        position = scan.pose_map_base[:3]
        if len(self._fresh) >= _SCANS_BETWEEN:
            self._merge(position)
        if self._position is not None and np.hypot(*(position - self._position)[:2]) < self._settings.update_m:
            return None
        self._position = position
        return self._estimate(scan)

    def report(self) -> PileReport:
        """Return what there is so far."""
        last = next((one for one in reversed(self._history) if one.estimate.found), None)
        piles = () if self._decision is None else (PileApproach(self._decision, self._decision),)
        return PileReport(
            self._decision, self._decision or last, tuple(self._history), self._settings.method, piles=piles
        )

    def _estimate(self, scan: ScanHits) -> Snapshot:
        self._merge(scan.pose_map_base[:3])
        x, y, z, heading = (float(value) for value in scan.pose_map_base)
        T_map_base = se3.from_rpy(0.0, 0.0, heading, (x, y, z))
        estimate = figure9(self._points, T_map_base, self._constants)
        distance = math.nan
        if len(estimate.toe_m):
            distance = float(np.linalg.norm(estimate.toe_m - scan.pose_map_base[:3], axis=1).min())
        snapshot = Snapshot(scan.stamp_ns, distance, estimate)
        self._history.append(snapshot)
        self._ended = loop_ends(estimate, T_map_base, self._constants)
        if self._ended and estimate.found:
            self._decision = snapshot
        return snapshot

    def _merge(self, position: FloatArray) -> None:
        """Keep one point a cell, near the machine's position (3,)."""
        points = np.concatenate([self._points, *self._fresh])
        points = points[np.hypot(*(points - position)[:, :2].T) < self._settings.reach_m]
        _, first = np.unique(np.floor(points / _CELL_M).astype(np.int64), axis=0, return_index=True)
        self._points, self._fresh = points[np.sort(first)], []
