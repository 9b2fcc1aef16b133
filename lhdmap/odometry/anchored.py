"""The default odometry: each scan is matched against a local map of the walls, with the motion's prediction as a prior."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry import motion_filter
from lhdmap.odometry.matching import Match, MatchModel, match
from lhdmap.odometry.search import search
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, SearchSettings
from lhdmap.odometry.surface_map import empty_map, insert_all

_RECENT_SCANS = 12
_LOST_BEFORE_RESTART = 5


class Anchored(NamedTuple):
    """What one scan gave: the match, the posterior pose's covariance against the map (map axes) and whether it was found."""

    pose: FloatArray
    information: FloatArray
    prior_information: FloatArray
    residual_m: float
    support: float
    lost: bool


class AnchoredMatcher:
    """Keeps the wall map and the motion filter; `step` is the whole method."""

    def __init__(self, settings: OdometrySettings, anchor: AnchorSettings, wide: SearchSettings) -> None:
        self._settings, self._anchor, self._wide = settings, anchor, wide
        self._model = MatchModel(
            settings.range_noise_m, anchor.cutoff_sigmas, anchor.min_cells, anchor.coarse_noise, anchor.rounds
        )
        self._accelerations = np.array(
            [settings.forward_acceleration, settings.lateral_acceleration, settings.turning_acceleration]
        )
        self._map = empty_map(anchor.cell_m)
        self._recent: list[FloatArray] = []
        self._inserted: FloatArray | None = None
        self._lost_in_a_row = 0
        self.state, self.P = motion_filter.initial(np.zeros(3))

    @property
    def velocity(self) -> FloatArray:
        """Forward, lateral, turning speed, shape (3,)."""
        return self.state[3:6]

    def predict(self, dt_s: float) -> None:
        """Move the motion model on."""
        motion_filter.predict(self.state, self.P, dt_s, self._accelerations)

    def fuse_speed(self, axis: int, measured: float, sigma: float, *, scaled: bool) -> bool:
        """Fuse a wheel speed (axis 3 forward, 5 turning); False where it contradicts the motion (slip) and was left out."""
        gate = 4.0
        return motion_filter.update_speed(self.state, self.P, axis, measured, sigma**2, scaled, gate) <= gate**2

    def step(self, points: FloatArray) -> Anchored:
        """Match points (N, 2), level base frame, at the predicted pose; then update motion and map."""
        before = self.state[:3].copy()
        prior_information = np.linalg.inv(self.P[:3, :3] + 1e-12 * np.eye(3))
        if self._inserted is None or len(points) < 10:
            return self._blind(points, prior_information)
        result = self._match(points, prior_information)
        lost = result.support < self._anchor.min_support
        if lost:
            self._lost_in_a_row += 1
            if self._lost_in_a_row >= _LOST_BEFORE_RESTART:
                self._restart(points)
            return Anchored(self.state[:3].copy(), np.zeros((3, 3)), prior_information, math.nan, result.support, lost=True)
        self._lost_in_a_row = 0
        motion_filter.update_pose(self.state, self.P, result.pose, result.information)
        self._forget(before)
        self._grow(points, result)
        residual_m = result.residual_sigmas * self._settings.range_noise_m
        return Anchored(self.state[:3].copy(), result.information, prior_information, residual_m, result.support, lost=False)

    def _match(self, points: FloatArray, prior_information: FloatArray) -> Match:
        """Match from the prediction; where that does not fit, from the best places of a wide search."""
        predicted = self.state[:3].copy()
        result = match(self._map, points, predicted, prior_information, predicted, self._model)
        if self._trusted(result):
            return result
        sigma = np.sqrt(np.diag(self.P)[:3])
        reach = np.array(
            [
                min(max(3.0 * float(sigma[:2].max()), 0.3), self._wide.reach_m),
                min(max(3.0 * float(sigma[2]), math.radians(20.0)), math.radians(self._wide.turn_deg)),
            ]
        )
        thin = points[:: max(len(points) // self._wide.beams, 1)]
        starts = search(
            np.concatenate(self._recent), thin, predicted, prior_information, reach, self._wide.cell_m,
            math.radians(self._wide.step_deg),
        )
        # A jump contradicts the prior by definition: it must not hold the match back, so it is weakened here.
        weak = 0.01 * prior_information
        for start in starts[np.isfinite(starts).all(axis=1) & (np.abs(starts) < 1e29).all(axis=1)]:
            found = match(self._map, points, predicted, weak, start, self._model)
            if found.support > result.support + 0.02:
                result = found
        return result

    def _trusted(self, result: Match) -> bool:
        """Return whether most of the hits that the map covers agree with it."""
        return result.support > 0.6 or (result.support > 0.8 * result.covered and result.support > self._anchor.min_support)

    def _blind(self, points: FloatArray, prior_information: FloatArray) -> Anchored:
        """Start the map, or go on by the motion alone where the scan has no returns."""
        if self._inserted is None and len(points) >= 10:
            self._insert(points)
            return Anchored(self.state[:3].copy(), 1e8 * np.eye(3), prior_information, 0.0, 1.0, lost=False)
        return Anchored(self.state[:3].copy(), np.zeros((3, 3)), prior_information, math.nan, 0.0, lost=len(points) < 10)

    def _restart(self, points: FloatArray) -> None:
        """Begin a new map at the predicted pose: nothing that was known fits what is seen."""
        self._map = empty_map(self._anchor.cell_m)
        self._recent.clear()
        self._lost_in_a_row = 0
        self._insert(points)

    def _forget(self, before: FloatArray) -> None:
        travelled = float(np.hypot(*(self.state[:2] - before[:2])))
        motion_filter.forget_pose(self.P, 1.0 - math.exp(-travelled / self._anchor.memory_m))

    def _grow(self, points: FloatArray, result: Match) -> None:
        """Insert the scan where the machine has moved on; hits that contradict a known wall stay out (people, dust)."""
        assert self._inserted is not None
        moved = np.hypot(*(self.state[:2] - self._inserted[:2]))
        turned = abs(se2.wrap(self.state[2] - self._inserted[2]))
        if moved < self._anchor.insert_m and turned < math.radians(self._anchor.insert_deg) and len(self._recent) > 3:
            return
        self._insert(points)

    def _insert(self, points: FloatArray) -> None:
        hits = se2.transform(self.state[:3], points)
        insert_all(self._map, hits, self._anchor.hit_limit)
        self._recent = [*self._recent[1 - _RECENT_SCANS :], hits]
        self._inserted = self.state[:3].copy()
