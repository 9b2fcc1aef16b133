"""Range flow with an adaptive frame rate: the paper's odometry. Scans are compared with reference scans some way back.

The error of a pair hardly depends on the distance between its scans, so references are renewed only after `spacing_m`: near
enough that both see the same walls, far enough that few pairs add up.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.range_flow.reference import FlowReference, compare, correct_by, scanner_pyramid
from lhdmap.odometry.range_flow.scan import Pyramid
from lhdmap.odometry.settings import OdometrySettings, RangeFlowSettings
from lhdmap.odometry.steps import BY_DEFINITION, Matched

_FEWEST_HITS = 12  # as many as one comparison needs at least (`flow`)


class FlowMatcher:
    """Keeps the reference scans; `step` is the whole method."""

    def __init__(self, motion: PlanarMotion, settings: OdometrySettings, range_flow: RangeFlowSettings) -> None:
        self._motion, self._noise_m, self._settings = motion, settings.range_noise_m, range_flow
        self._references: list[FlowReference] = []
        self._newest = np.zeros(3)  # pose of base_link at the newest reference

    def step(self, points: FloatArray, pose_base_scanner: FloatArray) -> Matched:
        """Compare points (N, 2), level base frame, with the references; correct the motion; renew the references."""
        if len(points) < _FEWEST_HITS:
            return Matched(np.zeros((3, 3)), math.nan, 0.0, lost=True)
        levels = scanner_pyramid(points, pose_base_scanner, self._settings)
        if not self._references:
            self._refer(levels, pose_base_scanner)
            return Matched(BY_DEFINITION, 0.0, 1.0, lost=False)
        found = [
            compare(one, levels, pose_base_scanner, self._motion, self._noise_m, self._settings)
            for one in self._references
        ]
        best = max(found, key=lambda one: one.support)
        agreeing = [one for one in found if one.support >= self._settings.min_support]
        if not agreeing:
            self._references.clear()
            self._refer(levels, pose_base_scanner)
            return Matched(np.zeros((3, 3)), math.nan, best.support, lost=True)
        information = correct_by(self._motion, agreeing)
        self._renew(levels, pose_base_scanner)
        return Matched(information, best.residual_sigmas * self._noise_m, best.support, lost=False)

    def _renew(self, levels: Pyramid, pose_base_scanner: FloatArray) -> None:
        """Make the scan a reference once it is far enough from the last one; a new reference is known by definition."""
        step = se2.between(self._newest, self._motion.pose)
        turned = abs(step[2]) >= math.radians(self._settings.spacing_deg)
        if turned or np.hypot(step[0], step[1]) >= self._settings.spacing_m:
            self._refer(levels, pose_base_scanner)
            self._motion.forget(1.0)

    def _refer(self, levels: Pyramid, pose_base_scanner: FloatArray) -> None:
        self._newest = self._motion.pose
        reference = FlowReference(se2.compose(self._newest, pose_base_scanner), levels)
        self._references = [*self._references, reference][-self._settings.references :]
