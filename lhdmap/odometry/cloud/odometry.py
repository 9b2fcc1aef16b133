"""Odometry of a 3D scanner as a stage: clouds in, poses of `base_link` in space out, one for each cloud."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se3
from lhdmap.geometry.twist import exp
from lhdmap.messages import FloatArray, PointCloud
from lhdmap.odometry.cloud.matchers import (
    CloudMatcher,
    CloudPrediction,
    KissMatcher,
    PreparedCloud,
    VgicpMatcher,
    prepare,
)
from lhdmap.odometry.cloud.motion import CloudMotion, CloudPrior
from lhdmap.odometry.cloud.planes import PlaneFit
from lhdmap.odometry.cloud.settings import CloudOdometrySettings
from lhdmap.odometry.cloud.steps import CloudStep, marginal_information, starts_along, travel_m, turn_rad
from lhdmap.odometry.cloud.sweep import CloudSweep, SweepClock, sweep_of
from lhdmap.scan_matching.scan_points import NO_BOXES

_FIRST_CLOUDS = 10  # enter the map and are processed at any speed: one cloud is no map
_LOST_BEFORE_RESTART = 10  # clouds: a second at 10 Hz
_BODY = [3, 4, 2]  # forward, lateral, heading as components of a twist
_SMEAR_M = 0.02  # error of the sweep's correction that is worth a second match
_SHORTEST_S = 0.05  # between clouds: stamps that bunch make no speed
_BY_DEFINITION = 1e8 * np.eye(6)  # information of the pose that defines a frame
_WIDE_PRIOR = 0.01  # a jump contradicts the prior by definition: it must not hold the match back


class _First(NamedTuple):
    """The first cloud, the middle of its sweep after its stamp (s), and the velocity (6,) that undid it."""

    sweep: CloudSweep
    middle_s: float
    twist: FloatArray


class _Placed(NamedTuple):
    """What a cloud was found to be: `fit` is None where it was not matched."""

    fit: PlaneFit | None
    lost: bool = False


class CloudOdometry:
    """Odometry with an adaptive rate: motion model, then a matcher (`settings.method`) that corrects it.

    `update` takes clouds in time order with the mount of the scanner, and where there are any the wheels' motion since
    the cloud before and the machine's roll and pitch. It never raises on the content of a cloud. The motion model runs
    on the middles of the sweeps.
    """

    def __init__(self, settings: CloudOdometrySettings | None = None) -> None:
        self._settings = settings or CloudOdometrySettings()
        self._motion = CloudMotion(self._settings)
        self._matcher: CloudMatcher = (
            KissMatcher(self._settings) if self._settings.method == "kiss_icp" else VgicpMatcher(self._settings)
        )
        self._clock = SweepClock()
        self._first: _First | None = None
        self._processed_pose = self._inserted_pose = np.eye(4)
        self._wait_s = 0.0
        self._processed = self._inserts = self._lost_in_a_row = 0
        self._wheels_used = False

    @property
    def map_size(self) -> int:
        """Number of voxels in the map."""
        return len(self._matcher)

    def update(
        self,
        cloud: PointCloud,
        T_base_sensor: FloatArray,
        prior: CloudPrior | None = None,
        T_level_base: FloatArray | None = None,
        boxes_m: FloatArray = NO_BOXES,
    ) -> CloudStep:
        """Process one cloud.

        Args:
            cloud: the cloud; points that are not finite are left out.
            T_base_sensor: mount of the scanner (4, 4).
            prior: motion by the wheels since the cloud before.
            T_level_base: roll and pitch of the machine as a pose (4, 4); the first one starts the odometry level.
            boxes_m: (K, 6), x y z minimum and maximum of the machine's bodies in `base_link`: own hits are left out.
        """
        self._predict(cloud, prior, T_level_base)
        if not self._due():
            return self._step(cloud.stamp_ns, None, self._motion.P[:6, :6])
        limits_m = (self._settings.min_range_m, self._settings.max_range_m)
        placed = self._place(sweep_of(cloud, T_base_sensor, limits_m, boxes_m))
        covariance = self._motion.P[:6, :6].copy()
        if placed.fit is not None:
            moved_m = travel_m(se3.inverse(self._processed_pose) @ self._motion.pose)
            self._motion.forget(min(moved_m / self._settings.memory_m, 1.0))
        self._processed += 1
        self._processed_pose, self._wait_s = self._motion.pose, 0.0
        return self._step(cloud.stamp_ns, placed, covariance)

    def _predict(self, cloud: PointCloud, prior: CloudPrior | None, T_level_base: FloatArray | None) -> None:
        """Move the motion model to the middle of the sweep."""
        first = not self._clock.runs
        dt_s, to_middle_s = self._clock.step(cloud)
        self._wheels_used = prior is not None and self._motion.fuse_prior(prior, dt_s)
        self._motion.predict(to_middle_s)
        self._wait_s += dt_s
        if T_level_base is not None and np.isfinite(T_level_base).all():
            self._level(T_level_base, first=first)

    def _level(self, T_level_base: FloatArray, *, first: bool) -> None:
        """Start level, then hold roll and pitch near the given ones: the map alone lets them drift."""
        if first:
            roll, pitch, _ = se3.to_rpy(T_level_base)
            self._motion.pose = se3.from_rpy(roll, pitch, 0.0)
        else:
            self._motion.fuse_tilt(T_level_base)

    def _due(self) -> bool:
        """Return whether this cloud is to be processed: after enough travel, turn or time, the first ones always."""
        s = self._settings
        step = se3.inverse(self._processed_pose) @ self._motion.pose
        moved = travel_m(step) >= s.step_m or turn_rad(step) >= math.radians(s.step_deg)
        return moved or self._wait_s >= s.step_s or self._inserts < _FIRST_CLOUDS or self._lost_in_a_row > 0

    def _place(self, sweep: CloudSweep) -> _Placed:
        """Match the cloud and correct the motion; on a new velocity undo the sweep and match once more."""
        cloud = self._prepare(sweep)
        if cloud is None:
            return _Placed(None, lost=True)
        if not self._inserts:
            return self._begin(sweep, cloud)
        before, prior = self._motion.twist, self._motion.P
        fit = self._match(cloud)
        if fit is None:
            return self._lose(cloud)
        if self._jumped(fit):
            self._motion.relocate(fit.pose)
            return self._accept(cloud, fit)._replace(lost=True)
        self._motion.correct(fit.pose, fit.information)
        again = self._again(sweep, self._motion.twist - before, prior)
        return self._accept(*(again or (cloud, fit)))

    def _prepare(self, sweep: CloudSweep) -> PreparedCloud | None:
        return prepare(sweep.undone(self._motion.twist), self._settings.sample_m)

    def _begin(self, sweep: CloudSweep, cloud: PreparedCloud) -> _Placed:
        """Start the map with one cloud at the predicted pose."""
        self._first = _First(sweep, self._clock.middle_s, self._motion.twist) if self._processed == 0 else None
        self._insert(cloud)
        return _Placed(PlaneFit(self._motion.pose, _BY_DEFINITION, 0.0, 1.0))

    def _match(self, cloud: PreparedCloud) -> PlaneFit | None:
        """Return the fit near the prediction or, where that fails, in its surroundings; None where nothing fits."""
        s, motion = self._settings, self._motion
        sigma_m = float(np.sqrt(motion.P[3, 3]))
        reach_m = min(3.0 * sigma_m, s.reach_m) if sigma_m > 0.5 * s.voxel_m else 0.0
        near = CloudPrediction(motion.pose, motion.prior_information, starts_along(motion.pose, reach_m, s.voxel_m))
        fit = self._matcher.match(cloud, near)
        if not self._trusted(fit):
            starts = starts_along(motion.pose, s.reach_m, s.voxel_m, turned=True)
            fit = self._matcher.match(cloud, CloudPrediction(motion.pose, _WIDE_PRIOR * near.information, starts))
        return fit if self._trusted(fit) else None

    def _trusted(self, fit: PlaneFit) -> bool:
        """Return whether enough of the points agree with the map."""
        return fit.support >= self._settings.min_support

    def _jumped(self, fit: PlaneFit) -> bool:
        """Return whether the fit is farther from the last pose than the machine can have moved."""
        moved_m = travel_m(se3.inverse(self._processed_pose) @ fit.pose)
        return moved_m > self._settings.max_speed_mps * max(self._wait_s, _SHORTEST_S)

    def _again(self, sweep: CloudSweep, change: FloatArray, prior: FloatArray) -> tuple[PreparedCloud, PlaneFit] | None:
        """Match once more where the velocity that undid the sweep was off by `change` (6,); None where it was not.

        The first cloud was taken as measured at rest: it is undone anew, too, and the map begun anew with it.
        """
        first, self._first = self._first, None
        if first is not None:
            change = self._motion.twist - first.twist
        if sweep.smear_m(change) < _SMEAR_M:
            return None
        if first is not None:
            self._begin_again(first)
        cloud = self._prepare(sweep)
        self._motion.P = prior
        fit = None if cloud is None else self._match(cloud)
        if cloud is None or fit is None:
            return None
        self._motion.correct(fit.pose, fit.information)
        return cloud, fit

    def _begin_again(self, first: _First) -> None:
        """Begin the map anew with the first cloud, whose stamp (not its middle) keeps the pose that was given out."""
        cloud, start = self._prepare(first.sweep), self._inserted_pose
        if cloud is None:
            return
        moved = start @ exp(first.middle_s * self._motion.twist)
        self._motion.pose = moved @ se3.inverse(start) @ self._motion.pose
        self._matcher.clear()
        self._matcher.insert(cloud, moved)
        self._inserted_pose = self._processed_pose = moved

    def _accept(self, cloud: PreparedCloud, fit: PlaneFit) -> _Placed:
        """Insert the cloud where the machine has moved on since the last one that was; the first ones always."""
        s = self._settings
        self._lost_in_a_row = 0
        step = se3.inverse(self._inserted_pose) @ self._motion.pose
        moved = travel_m(step) >= s.insert_m or turn_rad(step) >= math.radians(s.insert_deg)
        if moved or self._inserts < _FIRST_CLOUDS:
            self._insert(cloud)
        return _Placed(fit)

    def _lose(self, cloud: PreparedCloud) -> _Placed:
        """Go on by the motion alone; begin a new map at the predicted pose when nothing has fitted for a while."""
        self._lost_in_a_row += 1
        if self._lost_in_a_row >= _LOST_BEFORE_RESTART:
            self._matcher.clear()
            self._lost_in_a_row = self._inserts = 0
            self._insert(cloud)
        return _Placed(None, lost=True)

    def _insert(self, cloud: PreparedCloud) -> None:
        self._matcher.insert(cloud, self._motion.pose)
        self._inserts += 1
        self._inserted_pose = self._motion.pose

    def _step(self, stamp_ns: int, placed: _Placed | None, covariance: FloatArray) -> CloudStep:
        pose = self._motion.pose @ exp(-self._clock.middle_s * self._motion.twist)
        fit, lost = placed or _Placed(None)
        information = np.zeros(3) if fit is None else marginal_information(fit.information)[_BODY]
        weak = lost or (fit is not None and self._weak(information))
        substitute = "" if not weak else "wheels" if self._wheels_used else "motion"
        return CloudStep(
            stamp_ns=stamp_ns,
            T_odom_base=pose,
            covariance=covariance.copy(),
            velocity=self._motion.twist[_BODY],
            information=information,
            residual_m=math.nan if fit is None else fit.residual_m,
            support=math.nan if placed is None else 0.0 if fit is None else fit.support,
            degenerate=weak,
            substitute=substitute,
            processed=placed is not None,
            lost=lost,
        )

    def _weak(self, information: FloatArray) -> bool:
        s = self._settings
        limits = np.array([s.weak_sigma_m, s.weak_sigma_m, math.radians(s.weak_sigma_deg)])
        return bool((information * limits**2 < 1.0).any())
