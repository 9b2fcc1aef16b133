"""Odometry of a 3D scanner as a stage: clouds in, poses of `base_link` in space out, one for each cloud."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray, PointCloud
from lhdmap.odometry.cloud_matchers import Cloud, CloudMatcher, KissMatcher, Prediction, VgicpMatcher, prepare
from lhdmap.odometry.cloud_motion import CloudMotion, CloudPrior, exp
from lhdmap.odometry.cloud_planes import PlaneFit
from lhdmap.odometry.cloud_settings import CloudOdometrySettings
from lhdmap.odometry.scan_points import NO_BOXES

_FIRST_CLOUDS = 10
_LEAST_POINTS = 100
_LOST_BEFORE_RESTART = 10
_BODY = [3, 4, 2]  # forward, lateral, heading as components of a twist
_RESKEW_M = 0.02  # error of the sweep's correction that is worth a second match
_BY_DEFINITION = np.full(3, 1e8)


class CloudStep(NamedTuple):
    """Outcome of one cloud; as `OdometryStep`, in space.

    `T_odom_base`: pose (4, 4); `covariance`: (6, 6) of the pose against the local map, as the error twist in body axes,
    rotation (rad) before translation (m); `velocity`: forward, lateral (m/s), turning (rad/s); `information`: (3,) along,
    across (1/m²) and heading (1/rad²) of this cloud against the map, the other five unknown; `residual_m`: rms distance of
    the inliers; `support`: share of the points that agree with the map; `degenerate`: a direction was not observed;
    `substitute`: what stood in for it (`wheels`, `motion` or empty); `processed`: False where the adaptive rate only
    predicted; `lost`: the cloud did not fit the map, the pose is the prediction.
    """

    stamp_ns: int
    T_odom_base: FloatArray
    covariance: FloatArray
    velocity: FloatArray
    information: FloatArray
    residual_m: float
    support: float
    degenerate: bool
    substitute: str
    processed: bool
    lost: bool


class CloudOdometry:
    """Odometry with an adaptive rate: motion model, then a matcher (`settings.method`) that corrects it.

    `update` takes clouds in time order with the mount of the scanner, and where there are any the wheels' motion since the
    cloud before and the level frame's roll and pitch. It never raises on the content of a cloud.
    """

    def __init__(self, settings: CloudOdometrySettings | None = None) -> None:
        self._settings = settings or CloudOdometrySettings()
        self._motion = CloudMotion(self._settings)
        self._matcher: CloudMatcher
        self._matcher = (KissMatcher if self._settings.method == "kiss_icp" else VgicpMatcher)(self._settings)
        self._last_ns: int | None = None
        self._last_middle_s = self._middle_s = 0.0
        self._inserted: FloatArray | None = None
        self._processed_pose: FloatArray = np.eye(4)
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
        self._middle_s = _middle(cloud.time_offsets_s) if len(cloud.points_m) else self._last_middle_s
        self._predict(cloud.stamp_ns, prior, T_level_base)
        if not self._due():
            return self._step(cloud.stamp_ns, None, lost=False)
        points, times_s = self._hits(cloud, T_base_sensor, boxes_m)
        if len(points) < _LEAST_POINTS:
            return self._lose(cloud.stamp_ns, None)
        undone = undistorted(points, times_s - self._middle_s, self._motion.twist)
        if not self._inserts:
            return self._begin(cloud.stamp_ns, undone)
        return self._place(cloud.stamp_ns, points, times_s, undone)

    def _predict(self, stamp_ns: int, prior: CloudPrior | None, T_level_base: FloatArray | None) -> None:
        """Move the motion model to the cloud's stamp; one that runs backwards counts as no time."""
        first = self._last_ns is None
        dt_s = 0.0 if self._last_ns is None else max(stamp_ns - self._last_ns, 0) * 1e-9
        self._last_ns = stamp_ns if self._last_ns is None else max(stamp_ns, self._last_ns)
        self._wheels_used = prior is not None and self._motion.fuse_prior(prior, dt_s)
        self._motion.predict(max(dt_s + self._middle_s - self._last_middle_s, 0.0) if not first else 0.0)
        self._last_middle_s = self._middle_s
        self._wait_s += dt_s
        if T_level_base is None or not np.isfinite(T_level_base).all():
            return
        if first:
            roll, pitch, _ = se3.to_rpy(T_level_base)
            self._motion.pose = se3.from_rpy(roll, pitch, 0.0)
        else:
            self._motion.fuse_tilt(T_level_base)

    def _due(self) -> bool:
        """Return whether this cloud is to be processed: after enough travel, turn or time, the first ones always."""
        s = self._settings
        step = se3.inverse(self._processed_pose) @ self._motion.pose
        moved = _travel_m(step) >= s.step_m or _turn_rad(step) >= math.radians(s.step_deg)
        return moved or self._wait_s >= s.step_s or self._processed < _FIRST_CLOUDS

    def _hits(self, cloud: PointCloud, T_base_sensor: FloatArray, boxes_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points in `base_link` (N, 3) that are in range and not on the machine, and their times (N,) or (0,)."""
        points = np.asarray(cloud.points_m, dtype=np.float64).reshape(-1, 3)
        times = np.asarray(cloud.time_offsets_s, dtype=np.float64)
        with np.errstate(all="ignore"):
            ranges = np.sqrt(np.einsum("ij,ij->i", points, points))
            kept = (ranges >= self._settings.min_range_m) & (ranges <= self._settings.max_range_m)
            timed = len(times) == len(points)
            kept &= np.isfinite(times) if timed else True
        points = points[kept] @ T_base_sensor[:3, :3].T + T_base_sensor[:3, 3]
        times = times[kept] if timed else np.zeros(0)
        outside = np.isfinite(points).all(axis=1)
        for box in boxes_m:
            outside &= ~((points >= box[:3]) & (points <= box[3:])).all(axis=1)
        return points[outside], times[outside] if timed else times

    def _begin(self, stamp_ns: int, points: FloatArray) -> CloudStep:
        """Start the map with one cloud at the predicted pose."""
        cloud = prepare(points, self._settings.sample_m)
        self._insert(cloud)
        self._note_processed()
        covariance = self._motion.P[:6, :6].copy()
        return CloudStep(
            stamp_ns,
            self._pose_at_stamp(),
            covariance,
            self._velocity(),
            _BY_DEFINITION.copy(),
            0.0,
            1.0,
            False,
            "",
            True,
            False,
        )

    def _place(self, stamp_ns: int, points: FloatArray, times_s: FloatArray, undone: FloatArray) -> CloudStep:
        """Match the cloud; where that changed the velocity much, undo the sweep anew and match again."""
        cloud, fit = self._match(undone)
        if not self._trusted(fit):
            cloud, fit = self._match(undone, wide=True)
            if not self._trusted(fit):
                return self._lose(stamp_ns, fit, cloud)
        before = self._motion.twist
        travel_m = self._accept(fit)
        change = self._motion.twist - before
        if len(times_s) and float(np.abs(change[3:]).max()) * float(np.ptp(times_s)) > _RESKEW_M:
            cloud = prepare(undistorted(points, times_s - self._middle_s, self._motion.twist), self._settings.sample_m)
        covariance = self._motion.P[:6, :6].copy()
        self._grow(cloud)
        step = self._step(stamp_ns, fit, lost=False)._replace(covariance=covariance)
        self._motion.forget(min(travel_m / self._settings.memory_m, 1.0))
        return step

    def _match(self, points: FloatArray, *, wide: bool = False) -> tuple[Cloud, PlaneFit]:
        cloud = prepare(points, self._settings.sample_m)
        sigma_m = float(np.sqrt(self._motion.P[3, 3]))
        unsure = wide or sigma_m > 0.5 * self._settings.voxel_m
        reach_m = self._settings.reach_m if wide else min(3.0 * sigma_m, self._settings.reach_m)
        starts = _starts(self._motion.pose, reach_m, self._settings.voxel_m, turned=wide) if unsure else ()
        information = self._motion.prior_information * (0.01 if wide else 1.0)
        return cloud, self._matcher.match(cloud, Prediction(self._motion.pose, information, starts))

    def _trusted(self, fit: PlaneFit) -> bool:
        """Return whether enough of the hits agree with the map."""
        return fit.support >= self._settings.min_support and bool(np.isfinite(fit.pose).all())

    def _accept(self, fit: PlaneFit) -> float:
        """Correct the motion by the fit; return the travel since the last cloud processed, metres."""
        self._lost_in_a_row = 0
        self._motion.correct(fit.pose, fit.information)
        travel_m = _travel_m(se3.inverse(self._processed_pose) @ self._motion.pose)
        self._note_processed()
        return travel_m

    def _note_processed(self) -> None:
        self._processed += 1
        self._processed_pose, self._wait_s = self._motion.pose.copy(), 0.0

    def _lose(self, stamp_ns: int, fit: PlaneFit | None, cloud: Cloud | None = None) -> CloudStep:
        """Go on by the motion alone; begin a new map at the predicted pose when nothing has fitted for a while."""
        self._note_processed()
        if cloud is not None:
            self._lost_in_a_row += 1
        if cloud is not None and self._lost_in_a_row >= _LOST_BEFORE_RESTART:
            self._matcher.clear()
            self._lost_in_a_row = self._inserts = 0
            self._insert(cloud)
        return self._step(stamp_ns, fit, lost=True)

    def _grow(self, cloud: Cloud) -> None:
        """Insert the cloud where the machine has moved on since the last one that was; the first ones always."""
        s = self._settings
        step = se3.inverse(self._inserted if self._inserted is not None else np.eye(4)) @ self._motion.pose
        if (
            self._inserts < _FIRST_CLOUDS
            or _travel_m(step) >= s.insert_m
            or _turn_rad(step) >= math.radians(s.insert_deg)
        ):
            self._insert(cloud)

    def _insert(self, cloud: Cloud) -> None:
        self._matcher.insert(cloud, self._motion.pose)
        self._inserts += 1
        self._inserted = self._motion.pose.copy()

    def _pose_at_stamp(self) -> FloatArray:
        return self._motion.pose @ exp(-self._middle_s * self._motion.twist)

    def _velocity(self) -> FloatArray:
        return self._motion.twist[_BODY]

    def _step(self, stamp_ns: int, fit: PlaneFit | None, *, lost: bool) -> CloudStep:
        pose, covariance, velocity = self._pose_at_stamp(), self._motion.P[:6, :6].copy(), self._velocity()
        substitute = "wheels" if self._wheels_used else "motion"
        if fit is None:
            used = substitute if lost else ""
            return CloudStep(
                stamp_ns,
                pose,
                covariance,
                velocity,
                np.zeros(3),
                math.nan,
                0.0 if lost else math.nan,
                lost,
                used,
                lost,
                lost,
            )
        information = marginal_information(fit.information)[_BODY] * (0.0 if lost else 1.0)
        weak = lost or self._weak(information)
        return CloudStep(
            stamp_ns,
            pose,
            covariance,
            velocity,
            information,
            fit.residual_m,
            fit.support,
            weak,
            substitute if weak else "",
            True,
            lost,
        )

    def _weak(self, information: FloatArray) -> bool:
        s = self._settings
        limits = np.array([s.weak_sigma_m, s.weak_sigma_m, math.radians(s.weak_sigma_deg)])
        return bool((information * limits**2 < 1.0).any())


def _middle(times_s: npt.ArrayLike) -> float:
    """Return the mean time of a sweep after its stamp, seconds; zero where the points have no times."""
    times = np.asarray(times_s, dtype=np.float64)
    times = times[np.isfinite(times)]
    return float(np.clip(times.mean(), -1.0, 1.0)) if times.size else 0.0


def undistorted(points_m: FloatArray, times_s: FloatArray, twist: FloatArray) -> FloatArray:
    """Return points (N, 3) in `base_link` at the stamp, each measured `times_s` (N,) after it while moving with `twist`.

    The motion's series is cut after the second power of time: below 1 mm at 30 m for turns of 0.5 rad/s and 0.1 s.
    """
    if len(times_s) != len(points_m):
        return points_m
    omega, speed = twist[:3], twist[3:]
    t = times_s[:, None]
    first = np.cross(omega, points_m) + speed
    return points_m + t * first + 0.5 * t * t * np.cross(omega, first)


def marginal_information(H: FloatArray) -> FloatArray:
    """Return for each of the six components the information left when the other five are unknown, shape (6,)."""
    return 1.0 / np.diag(np.linalg.inv(H + np.diag([1e-6] * 6)))


def _starts(pose: FloatArray, reach_m: float, spacing_m: float, *, turned: bool) -> tuple[FloatArray, ...]:
    """Return poses (4, 4) along the machine's axis to either side of `pose`, and turned ones where wanted."""
    count = int(reach_m / spacing_m + 0.5)
    shifts = [k * spacing_m for i in range(1, count + 1) for k in (i, -i)]
    starts = [pose @ exp(np.array([0.0, 0.0, 0.0, shift, 0.0, 0.0])) for shift in shifts]
    for turn_deg in (10.0, -10.0, 20.0, -20.0) if turned else ():
        starts.append(pose @ exp(np.array([0.0, 0.0, math.radians(turn_deg), 0.0, 0.0, 0.0])))
    return tuple(starts)


def _travel_m(T: FloatArray) -> float:
    return float(np.linalg.norm(T[:3, 3]))


def _turn_rad(T: FloatArray) -> float:
    return math.acos(min(max(0.5 * (float(np.trace(T[:3, :3])) - 1.0), -1.0), 1.0))
