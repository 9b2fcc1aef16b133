"""A young map: near its first scan, range flow against that scan tells the heading.

A map of one scan knows sparse, distant walls badly, and an error of the heading made there stays for the whole drive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.range_flow.reference import FlowReference, compare, scanner_pyramid
from lhdmap.odometry.settings import RangeFlowSettings
from lhdmap.scan_matching.information import marginal_information

_HEADING_AXIS = np.diag([0.0, 0.0, 1.0])  # of the information of a pose: that of its heading


class YoungHeading(NamedTuple):
    """A heading (rad) and its information (1/rad²), which is 0 where none is known."""

    heading_rad: float = 0.0
    information: float = 0.0

    @property
    def matrix(self) -> FloatArray:
        """Its information as that of a pose, shape (3, 3)."""
        return self.information * _HEADING_AXIS


class YoungMap:
    """`begin` with the first scan of a map; `heading` compares the scans near it with it."""

    def __init__(self, motion: PlanarMotion, noise_m: float, reach_m: float, settings: RangeFlowSettings) -> None:
        self._motion, self._noise_m, self._reach_m, self._settings = motion, noise_m, reach_m, settings
        self._first: FlowReference | None = None
        self._origin = np.zeros(3)

    def begin(self, points: FloatArray, pose_base_scanner: FloatArray) -> None:
        """Take a map's first scan, hits (N, 3), at the motion's pose."""
        levels = scanner_pyramid(points, pose_base_scanner, self._settings)
        self._origin = self._motion.pose
        self._first = FlowReference(se2.compose(self._origin, pose_base_scanner), levels)

    def heading(self, points: FloatArray, pose_base_scanner: FloatArray) -> YoungHeading:
        """Return the heading by range flow against the first scan; none once the machine has left its surroundings."""
        near = np.hypot(*(self._motion.pose[:2] - self._origin[:2])) <= self._reach_m
        if self._first is None or not near:
            self._first = None
            return YoungHeading()
        levels = scanner_pyramid(points, pose_base_scanner, self._settings)
        found = compare(self._first, levels, pose_base_scanner, self._motion, self._noise_m, self._settings)
        if found.support < self._settings.min_support:
            return YoungHeading()
        return YoungHeading(float(found.pose[2]), float(marginal_information(found.information)[2]))
