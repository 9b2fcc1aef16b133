"""The default odometry: each scan is matched against a local map of the walls, with the motion's prediction as a prior."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.anchored.jump import jump, offset_of
from lhdmap.odometry.anchored.local_map import LocalMap
from lhdmap.odometry.anchored.rear_view import NOTHING_BEHIND, Behind
from lhdmap.odometry.anchored.scan_hits import HitChoice
from lhdmap.odometry.anchored.state import MatcherState
from lhdmap.odometry.anchored.young import YoungHeading, YoungMap
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, RangeFlowSettings, SearchSettings
from lhdmap.odometry.step_covariance import direction_noise
from lhdmap.odometry.steps import BY_DEFINITION, Matched
from lhdmap.odometry.wheels.model import WheelModel
from lhdmap.scan_matching.matching import Hits, Match, MatchModel, Prior
from lhdmap.scan_matching.slant import NO_RISE
from lhdmap.scan_matching.submap import weakened

_FEWEST_HITS = 10  # three unknowns, and walls to two sides at least: fewer hits are dust
_SPINNING_RPS = 2.0  # no machine turns so fast: after a jump to such a speed the one before it stands
_SURPRISE_SIGMAS = 3.5  # off the prediction: one scan in 150 by chance (three unknowns); else a jolt, or a wrong model
# Share of hits that agree from which a match needs no search; where the map covers less of the scan, the share of those that it
# covers.
_TRUSTED_SUPPORT, _TRUSTED_OF_COVERED = 0.6, 0.8
_EDGE_OF_COVERED = (
    0.5  # as much of what the map covers must agree where a scan sees mostly what the map does not hold yet
)
_FEWEST_AGREEING = 15  # hits that such a scan must have in common with the map: fewer agree by chance
# Deviations of the wheels' prediction up to which a scan may enter the map though it did not fit: within reach of the next match.
_SURE_M, _SURE_RAD = 0.2, math.radians(6.0)


class AnchoredMatcher:
    """Keeps the wall map; `step` is the whole method."""

    def __init__(
        self,
        motion: PlanarMotion,
        wheels: WheelModel,
        settings: OdometrySettings,
        anchor: AnchorSettings,
        wide: SearchSettings,
        range_flow: RangeFlowSettings,
    ) -> None:
        self._motion, self._wheels = motion, wheels
        self._noise_m, self._anchor, self._wide = settings.range_noise_m, anchor, wide
        self._map = LocalMap(settings, anchor, wide)
        self._young = YoungMap(motion, settings.range_noise_m, anchor.young_m, range_flow)
        self._hits = HitChoice()
        self._state = MatcherState()

    @property
    def behind(self) -> FloatArray:
        """The rear hits of the last scan, shape (N, 3), level base frame."""
        return self._hits.behind

    def step(
        self,
        points: FloatArray,
        pose_base_scanner: FloatArray,
        seen: Behind = NOTHING_BEHIND,
        rise: FloatArray = NO_RISE,
    ) -> Matched:
        """Match points (N, 3), level base frame with absolute heights, at the predicted pose; correct the motion, grow the map.

        A tilted scanner, whose plane rises by `rise` (2,), is helped by what is `seen` behind.
        """
        if self._state.begins_to_tilt(points):
            self._map.mixes_heights()
        if len(points) < _FEWEST_HITS:
            return _lost(0.0)
        if not self._map.begun:
            return self._begin(points, pose_base_scanner)
        heading = self._young.heading(points, pose_base_scanner)
        hits = self._hits.of(points, seen, rise, layered=self._state.layered)
        found = self._match(hits, self._prior(heading))
        if found.support < self._anchor.min_support and not self._at_the_edge(found, hits):
            return self._lose(points, pose_base_scanner, found.support)
        model = self._map.model  # that of this match
        self._state.find()
        self._map.learn_noise(found.residual_sigmas)
        self._hits.learn(found, hits, self._map.model, self._anchor.cell_m, seen.joint_x_m)
        self._correct(found, heading)
        self._map.grow(points, self._motion.pose, smooth=found.smooth)
        return self._told(found, hits, model)

    def _begin(self, points: FloatArray, pose_base_scanner: FloatArray) -> Matched:
        """Start the map with one scan; it is the reference for those that follow closely."""
        self._young.begin(points, pose_base_scanner)
        self._map.insert(points, self._motion.pose)
        return Matched(BY_DEFINITION, 0.0, 1.0, lost=False, noise=np.zeros((3, 3)))

    def _prior(self, heading: YoungHeading) -> Prior:
        """Return the motion's prediction, and a heading with its information."""
        predicted, information = self._motion.pose, self._motion.prior_information + heading.matrix
        if heading.information > 0.0:
            turn_rad = se2.wrap(heading.heading_rad - predicted[2])
            predicted += np.linalg.solve(information, np.array([0.0, 0.0, heading.information * turn_rad]))
        return Prior(predicted, information)

    def _match(self, hits: Hits, prior: Prior) -> Match:
        """Match from the prediction; where that does not fit, search widely."""
        self._state.jumped = False
        near = self._map.walls.align(hits, prior)
        if self._trusted(near):
            return self._freed(hits, near, prior)
        state = self._state
        found = jump(self._map.walls, hits, near, prior, self._motion, self._wheels, self._wide, state.offset)
        if found is None:
            return near
        state.jump(offset_of(found, prior))
        return found

    def _freed(self, hits: Hits, near: Match, prior: Prior) -> Match:
        """Match again with a weak prior where the scan contradicts it: motion that no model of the past predicts."""
        error = near.pose - prior.pose
        if error @ prior.information @ error < _SURPRISE_SIGMAS**2:
            return near
        again = self._map.walls.align(hits, weakened(prior), near.pose)
        return again if again.support >= near.support else near

    def _trusted(self, near: Match) -> bool:
        """Return whether most of the hits that the map covers agree with it."""
        return near.support > _TRUSTED_SUPPORT or (
            near.support > _TRUSTED_OF_COVERED * near.covered and near.support > self._anchor.min_support
        )

    def _at_the_edge(self, found: Match, hits: Hits) -> bool:
        """Return whether the scan sees mostly what the map does not hold yet, and enough of the rest agrees."""
        agrees = found.support > _EDGE_OF_COVERED * found.covered and found.support * hits.front >= _FEWEST_AGREEING
        return agrees and self._predicted_well()

    def _predicted_well(self) -> bool:
        """Return whether the wheels predict the pose well."""
        sigma = np.sqrt(np.diag(self._motion.P)[:3])
        return self._motion.measured and bool(sigma[:2].max() < _SURE_M and sigma[2] < _SURE_RAD)

    def _lose(self, points: FloatArray, pose_base_scanner: FloatArray, support: float) -> Matched:
        """Go on by the motion alone; begin a new map at the predicted pose when nothing has fitted for a while."""
        if self._predicted_well():
            self._map.insert(points, self._motion.pose)  # the next scan shall not be lost, too
        if self._state.lose():
            self._map.clear()
            self._begin(points, pose_base_scanner)
        return _lost(support)

    def _correct(self, found: Match, heading: YoungHeading) -> None:
        """Tell the motion where the scan was found; what it has driven since is renewed in the map, and so is its error."""
        motion = self._motion
        before, velocity = motion.pose, motion.velocity
        motion.correct(found.pose, found.information + heading.matrix)
        if self._state.jumped:
            spins = abs(motion.velocity[2]) > _SPINNING_RPS
            motion.distrust_velocity(velocity if spins else motion.velocity)
        after = motion.pose
        travelled_m = math.hypot(after[0] - before[0], after[1] - before[1])
        motion.forget(1.0 - math.exp(-travelled_m / self._anchor.memory_m))

    def _told(self, found: Match, hits: Hits, model: MatchModel) -> Matched:
        return Matched(
            found.information,
            found.residual_sigmas * self._noise_m,
            found.support,
            lost=False,
            doubtful=self._state.doubts(found.support),
            jumped=self._state.jumped,
            noise=direction_noise(found.pose, hits, found.lines, self._anchor.cell_m, model),
            layered=self._state.layered,
            alone=len(hits.points) == hits.front,
        )


def _lost(support: float) -> Matched:
    return Matched(np.zeros((3, 3)), math.nan, support, lost=True)
