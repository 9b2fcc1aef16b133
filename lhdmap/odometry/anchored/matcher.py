"""The default odometry: each scan is matched against a local map of the walls, with the motion's prediction as a prior."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.anchored.jump import NOTHING_OWED, jump, left_by
from lhdmap.odometry.anchored.rear_view import NO_POINTS, NOTHING_BEHIND, Behind, JointOffset
from lhdmap.odometry.motion import Motion
from lhdmap.odometry.range_flow.reference import FlowReference, compare, scanner_pyramid
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, RangeFlowSettings, SearchSettings
from lhdmap.odometry.step_covariance import direction_noise
from lhdmap.odometry.steps import BY_DEFINITION, Matched
from lhdmap.odometry.wheels.model import WheelModel
from lhdmap.scan_matching.information import marginal_information
from lhdmap.scan_matching.matching import Hits, Match, MatchModel, Prior
from lhdmap.scan_matching.search import SearchGrid
from lhdmap.scan_matching.slant import NO_RISE, slants
from lhdmap.scan_matching.submap import Submap, weakened

_RECENT_SCANS = 12
_YOUNG_SCANS = 4
_LOST_BEFORE_RESTART = 5
_FEWEST_HITS = 10
_HEADING_AXIS = np.diag([0.0, 0.0, 1.0])
# Scans that are flagged after a pose that the motion did not foretell: a jump, or someone beside the machine.
_DOUBT_SCANS = 25
_OWED_KEPT = 0.96  # of what jumps were off the motion, from scan to scan
_DOUBTFUL_SUPPORT = 0.58  # walls alone give 0.8 and more: less may be a crowd that moves along
_SPINNING_RPS = 2.0  # no machine turns so fast: after a jump to such a speed the one before it stands
_SURPRISE = 3.5  # sigmas from the prediction
_USUAL_RESIDUAL = 0.75  # weighted rms in sigmas that matches have whose noise is stated rightly
_NOISE_GAIN = 0.05
_NOISE_SCALES = (0.8, 6.0)
_FRONT_STEP = 3  # one in three hits of the front scanner: as exact with the rear one's, and faster
_FEWEST_AGREEING = 15  # hits
_FORETOLD_M, _FORETOLD_RAD = 0.2, math.radians(6.0)
_FLAT_M = 0.02  # a scan whose heights differ by less is planar


class AnchoredMatcher:
    """Keeps the wall map; `step` is the whole method."""

    def __init__(
        self,
        motion: Motion,
        wheels: WheelModel,
        settings: OdometrySettings,
        anchor: AnchorSettings,
        wide: SearchSettings,
        range_flow: RangeFlowSettings,
    ) -> None:
        self._flow = range_flow
        self._first: FlowReference | None = None
        self._motion, self._wheels = motion, wheels
        self._noise_m, self._anchor, self._wide = settings.range_noise_m, anchor, wide
        self._map = self._empty_map(_model(settings, anchor))
        self._inserted: FloatArray | None = None
        self._origin = np.zeros(3)
        self._lost_in_a_row = 0
        self._layered = False
        self._noise_scale = 1.0
        self._doubt = 0
        self._jumped = False
        self._owed = NOTHING_OWED
        self._joint = JointOffset()
        self._turn = 0
        self.behind = NO_POINTS  # the rear hits of the last scan, shape (N, 3), level base frame

    def _empty_map(self, model: MatchModel) -> Submap:
        wide = self._wide
        grid = SearchGrid(wide.cell_m, math.radians(wide.step_deg), wide.beams, apart_m=math.inf)
        return Submap(
            self._anchor.cell_m,
            model=model,
            grid=grid,
            hit_limit=self._anchor.hit_limit,
            remembers=_RECENT_SCANS,
        )

    def step(
        self,
        points: FloatArray,
        T_base_scanner: FloatArray,
        seen: Behind = NOTHING_BEHIND,
        rise: FloatArray = NO_RISE,
    ) -> Matched:
        """Match points (N, 3), level base frame with absolute heights, at the predicted pose; correct the motion, grow the map.

        A tilted scanner, whose plane rises by `rise` (2,), is helped by what is `seen` behind.
        """
        if not self._layered and len(points) and np.ptp(points[:, 2]) > _FLAT_M:
            self._layered = True  # coarse cells of a tilted scanner mix heights
            self._map.model = self._map.model._replace(coarse_noise=self._anchor.coarse_noise)
        if len(points) < _FEWEST_HITS:
            return Matched(np.zeros((3, 3)), math.nan, 0.0, lost=True)
        if self._inserted is None:
            return self._begin(points, T_base_scanner)
        heading = self._young_heading(points, T_base_scanner)
        before, velocity = self._motion.pose, self._motion.velocity
        self._jumped = False
        hits = self._hits(points, seen, rise)
        result = self._match(hits, heading)
        if result.support < self._anchor.min_support and not self._at_the_edge(result, hits):
            return self._lose(points, T_base_scanner, result.support)
        self._lost_in_a_row, model = 0, self._map.model
        self._learn_noise(result.residual_sigmas)
        if len(hits.points) > hits.front:
            self._joint.update(result, hits, self._map.model, self._anchor.cell_m, seen.joint_x_m)
        self._motion.correct(result.pose, result.information + heading[1] * _HEADING_AXIS)
        if self._jumped:
            spins = abs(self._motion.velocity[2]) > _SPINNING_RPS
            self._motion.distrust_velocity(velocity if spins else self._motion.velocity)
        after = self._motion.pose
        travelled = math.hypot(after[0] - before[0], after[1] - before[1])
        self._motion.forget(1.0 - math.exp(-travelled / self._anchor.memory_m))
        self._grow(points, smooth=result.smooth)
        doubtful = self._doubt > 0 or result.support < _DOUBTFUL_SUPPORT
        self._doubt = max(self._doubt - 1, 0)
        self._owed = _OWED_KEPT * self._owed if self._doubt else NOTHING_OWED
        residual_m = result.residual_sigmas * self._noise_m
        noise = direction_noise(result.pose, hits, result.lines, self._anchor.cell_m, model)
        alone = len(hits.points) == hits.front
        return Matched(
            result.information, residual_m, result.support, False, doubtful, self._jumped, noise, self._layered, alone
        )

    def _hits(self, points: FloatArray, seen: Behind, rise: FloatArray) -> Hits:
        """Return what is matched: a level scanner sees the same curve of the walls again by itself."""
        self.behind = NO_POINTS
        if not self._layered:
            return Hits(points, len(points), layered=False)
        along = slants(points, rise)
        if not len(seen.points):
            return Hits(points, len(points), True, along)
        self._turn = (self._turn + 1) % _FRONT_STEP
        front, self.behind = points[self._turn :: _FRONT_STEP], self._joint.turned(seen)
        both = np.concatenate([along[self._turn :: _FRONT_STEP], slants(self.behind, rise)])
        return Hits(np.concatenate([front, self.behind]), len(front), True, both)

    def _match(self, hits: Hits, heading: tuple[float, float]) -> Match:
        """Match from the prediction (and a heading with its information); where that does not fit, search widely."""
        predicted, motion = self._motion.pose, self._motion.prior_information
        information = motion + heading[1] * _HEADING_AXIS
        if heading[1] > 0.0:
            error = np.array([0.0, 0.0, heading[1] * se2.wrap(heading[0] - predicted[2])])
            predicted += np.linalg.solve(information, error)
        prior = Prior(predicted, information)
        result = self._map.align(hits, prior)
        if self._trusted(result):
            return self._freed(hits, result, prior)
        found = jump(self._map, hits, result, prior, self._motion, self._wheels, self._wide, self._owed)
        if found is None:
            return result
        self._doubt, self._jumped = _DOUBT_SCANS, True
        self._owed = self._owed + left_by(found, prior)
        return found

    def _freed(self, hits: Hits, result: Match, prior: Prior) -> Match:
        """Match again with a weak prior where the scan contradicts it: motion that no model of the past foretells."""
        error = result.pose - prior.pose
        if error @ prior.information @ error < _SURPRISE**2:
            return result
        again = self._map.align(hits, weakened(prior), result.pose)
        return again if again.support >= result.support else result

    def _trusted(self, result: Match) -> bool:
        """Return whether most of the hits that the map covers agree with it."""
        return result.support > 0.6 or (
            result.support > 0.8 * result.covered and result.support > self._anchor.min_support
        )

    def _at_the_edge(self, result: Match, hits: Hits) -> bool:
        """Return whether the scan sees mostly what the map does not hold yet, and half of that agrees."""
        agrees = result.support > 0.5 * result.covered and result.support * hits.front >= _FEWEST_AGREEING
        return agrees and self._foretold()

    def _foretold(self) -> bool:
        """Return whether the wheels foretell the pose well."""
        sigma = np.sqrt(np.diag(self._motion.P)[:3])
        return self._motion.measured and bool(sigma[:2].max() < _FORETOLD_M and sigma[2] < _FORETOLD_RAD)

    def _begin(self, points: FloatArray, T_base_scanner: FloatArray) -> Matched:
        """Start the map with one scan; it is the reference for those that follow closely."""
        levels = scanner_pyramid(points, T_base_scanner, self._flow)
        self._first = FlowReference(se2.compose(self._motion.pose, T_base_scanner), levels)
        self._origin = self._motion.pose
        self._insert(points)
        return Matched(BY_DEFINITION, 0.0, 1.0, lost=False, noise=np.zeros((3, 3)))

    def _young_heading(self, points: FloatArray, T_base_scanner: FloatArray) -> tuple[float, float]:
        """Return heading and its information by range flow against the first scan while near it; else no information.

        A map of one scan knows sparse, distant walls badly, and an error of the heading made there stays for the whole drive.
        """
        near = np.hypot(*(self._motion.pose[:2] - self._origin[:2])) <= self._anchor.young_m
        if self._first is None or not near:
            self._first = None
            return 0.0, 0.0
        levels = scanner_pyramid(points, T_base_scanner, self._flow)
        found = compare(self._first, levels, T_base_scanner, self._motion, self._noise_m, self._flow)
        if found.support < self._flow.min_support:
            return 0.0, 0.0
        return float(found.pose[2]), float(marginal_information(found.information)[2])

    def _lose(self, points: FloatArray, T_base_scanner: FloatArray, support: float) -> Matched:
        """Go on by the motion alone; begin a new map at the predicted pose when nothing has fitted for a while."""
        self._lost_in_a_row += 1
        if self._foretold():
            self._insert(points)  # the next scan shall not be lost, too
        if self._lost_in_a_row >= _LOST_BEFORE_RESTART:
            self._map = self._empty_map(self._map.model)
            self._lost_in_a_row = 0
            self._begin(points, T_base_scanner)
        return Matched(np.zeros((3, 3)), math.nan, support, lost=True)

    def _learn_noise(self, residual_sigmas: float) -> None:
        """Follow the scanner's real noise (rounding to centimetres, dust) from the size of the residuals."""
        self._noise_scale *= min(max(residual_sigmas / _USUAL_RESIDUAL, 0.5), 2.0) ** _NOISE_GAIN
        self._noise_scale = min(max(self._noise_scale, _NOISE_SCALES[0]), _NOISE_SCALES[1])
        self._map.model = self._map.model._replace(noise_m=self._noise_m * self._noise_scale)

    def _grow(self, points: FloatArray, *, smooth: bool) -> None:
        """Insert the scan where the machine has moved on since the last one that was; the first scans always.

        But not where walls are smooth: chords between the same far hits, again and again, hold a machine where it stood.
        """
        step = self._motion.pose - (self._inserted if self._inserted is not None else np.zeros(3))
        still = np.hypot(*step[:2]) < self._anchor.insert_m and abs(se2.wrap(step[2])) < math.radians(
            self._anchor.insert_deg
        )
        if not still or (self._map.scans < _YOUNG_SCANS and not smooth):
            self._insert(points)

    def _insert(self, points: FloatArray) -> None:
        self._map.insert(points, self._motion.pose)
        self._inserted = self._motion.pose


def _model(settings: OdometrySettings, anchor: AnchorSettings) -> MatchModel:
    """Return how far a level scanner's hits may be from the walls that it saw a moment ago."""
    return MatchModel(
        settings.range_noise_m,
        anchor.cutoff_sigmas,
        anchor.min_cells,
        0.0,
        anchor.rounds,
        anchor.lean,
        anchor.lean_patch_m,
    )
