"""Planar odometry as a stage: scans in, poses of `base_link` in the level plane out, one for each scan."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.anchored.matcher import AnchoredMatcher
from lhdmap.odometry.anchored.rear_view import NO_POINTS, NOTHING_BEHIND, Behind, RearView, behind
from lhdmap.odometry.clock import ScanClock
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.range_flow.matcher import FlowMatcher
from lhdmap.odometry.rate import AdaptiveRate
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, RangeFlowSettings, SearchSettings
from lhdmap.odometry.step_covariance import StepErrors
from lhdmap.odometry.steps import Matched, OdometryStep, WheelStep
from lhdmap.odometry.trust_settings import TrustSettings
from lhdmap.odometry.wheels.gyro import GyroTurn
from lhdmap.odometry.wheels.model import WheelModel
from lhdmap.scan_matching.information import body_information, inflated, marginal_information
from lhdmap.scan_matching.scan_points import NO_BOXES, half_sweep_ns, planar_points
from lhdmap.scan_matching.slant import NO_RISE
from lhdmap.scan_matching.step_error import NO_ERROR

_SLOWEST_REAR_MPS = 0.1  # below it the rear scanner sees what it saw before
_MOSTLY_NOISE = 0.5  # of what a scan tells: then the walls tell nothing of one direction
_WALLS_ALONE = 0.6  # support below which a crowd may be what the scan is held by


class ScanView(NamedTuple):
    """What else is known of a scan's surroundings.

    `height_m` of `base_link` in `odom`; `boxes_m` (K, 6): own bodies; `rear`: tells what the rear scanner sees at the same
    time, asked for the scans that are processed only; `rise` (2,): of the scanner's plane (`slant.rise_of`); `levelled`: an
    inclinometer tells roll and pitch; `turn_rad`: since the scan before, by a gyroscope.
    """

    height_m: float = 0.0
    boxes_m: FloatArray = NO_BOXES
    rear: Callable[[], RearView | None] | None = None
    rise: FloatArray = NO_RISE
    levelled: bool = True
    turn_rad: float | None = None


class _Judged(NamedTuple):
    """A match in the body's axes.

    `information` (3,): what the scan tells along, across and of the heading, the others unknown; `weak`: whether that is too
    little of one; `covariance` (3, 3): of the pose against the local map.
    """

    information: FloatArray
    weak: bool
    covariance: FloatArray


_PLAIN = ScanView()  # of a scan of which nothing else is known
Placement = FloatArray | Callable[[], FloatArray]


class PlanarOdometry:
    """Odometry with an adaptive frame rate: motion model, then a matcher (`settings.method`) that corrects it.

    `update` takes scans in time order with the pose of the sensor in the machine's level frame, and the wheels' motion since
    the scan before where there is any.
    """

    def __init__(
        self,
        settings: OdometrySettings | None = None,
        anchor: AnchorSettings | None = None,
        wide: SearchSettings | None = None,
        range_flow: RangeFlowSettings | None = None,
        velocity: FloatArray | None = None,
        trust: TrustSettings | None = None,
    ) -> None:
        self._settings = settings or OdometrySettings()
        self._motion = PlanarMotion(self._settings, velocity)
        self.wheels, self.gyro = WheelModel(self._settings, self._motion), GyroTurn(self._motion)
        self._matcher: AnchoredMatcher | FlowMatcher
        if self._settings.method == "range_flow":
            self._matcher = FlowMatcher(self._motion, self._settings, range_flow or RangeFlowSettings())
        else:
            self._matcher = AnchoredMatcher(
                self._motion,
                self.wheels,
                self._settings,
                anchor or AnchorSettings(),
                wide or SearchSettings(),
                range_flow or RangeFlowSettings(),
            )
        self._clock = ScanClock()
        self._turn = 0
        self._rate = AdaptiveRate(self._settings)
        self._errors, self._error = StepErrors(trust or TrustSettings()), NO_ERROR
        self.points = np.zeros((0, 3))  # hits of the last processed scan, level base frame, heights in odom

    def update(
        self, scan: LaserScan, T_level_sensor: Placement, wheels: WheelStep | None = None, view: ScanView = _PLAIN
    ) -> OdometryStep:
        """Process one scan; `T_level_sensor` (4, 4): mount and attitude, or what tells it where the scan is processed."""
        dt_s = self._clock.step(scan.stamp_ns)
        self._motion.predict(dt_s)
        self.wheels.fuse(wheels, dt_s)
        self.gyro.fuse(view.turn_rad, dt_s)
        if not self._rate.due(dt_s, self._motion.velocity) and not self._clock.bunched:
            return self._skipped(scan)
        if not isinstance(T_level_sensor, np.ndarray):
            T_level_sensor = T_level_sensor()
        floor_m = self._settings.min_height_m if T_level_sensor[2, 3] > 2.0 * self._settings.min_height_m else -math.inf
        points = planar_points(scan, T_level_sensor, self._motion.velocity, floor_m, view.boxes_m, self._part(scan))
        points[:, 2] += view.height_m
        self.points = points
        mount = _planar_mount(T_level_sensor)
        if isinstance(self._matcher, FlowMatcher):
            matched = self._matcher.step(points, mount)
        else:
            matched = self._matcher.step(points, mount, self._behind(view, floor_m), view.rise)
        judged = self._judged(matched)
        held = matched.support > _WALLS_ALONE and not judged.weak
        self.wheels.learn(self._motion.pose, matched, held=held and not matched.lost)
        self.gyro.learn(
            self._motion.pose, held=not (matched.lost or matched.doubtful or self._blind(judged.information))
        )
        self._error = self._errors.of(self._motion.pose, matched, judged.covariance, levelled=view.levelled)
        return self._step(scan, matched, judged)

    def _judged(self, matched: Matched) -> _Judged:
        heading_rad = self._motion.state[2]
        information = marginal_information(body_information(matched.information, heading_rad))
        return _Judged(information, self._weak(information), body_information(self._motion.P[:3, :3], heading_rad))

    def _behind(self, view: ScanView, floor_m: float) -> Behind:
        """Return the rear scanner's hits; at rest they add nothing."""
        velocity = self._motion.velocity
        rear = view.rear() if view.rear is not None and abs(velocity[0]) >= _SLOWEST_REAR_MPS else None
        if rear is None:
            return NOTHING_BEHIND
        return behind(rear, velocity, view.height_m, floor_m, self._settings.max_rear_beams)

    def _part(self, scan: LaserScan) -> tuple[int, int]:
        """Return first beam and step so that no more than `max_beams` are used, another part each time."""
        step = -(-scan.ranges_m.size // self._settings.max_beams)
        self._turn += 1
        return self._turn % max(step, 1), max(step, 1)

    @property
    def points_behind(self) -> FloatArray:
        """Hits of the rear scanner that the last processed scan was matched with, shape (N, 3), as `points`."""
        return self._matcher.behind if isinstance(self._matcher, AnchoredMatcher) else NO_POINTS

    @property
    def clock(self) -> ScanClock:
        """What the motion model believes of the stamps."""
        return self._clock

    def _skipped(self, scan: LaserScan) -> OdometryStep:
        pose = self._motion.pose
        return OdometryStep(
            scan.stamp_ns,
            scan.stamp_ns + half_sweep_ns(scan),
            pose,
            body_information(self._motion.P[:3, :3], pose[2]),
            self._motion.velocity,
            np.zeros(3),
            math.nan,
            math.nan,
            False,
            "",
            False,
            False,
            self.wheels.use,
        )

    def _step(self, scan: LaserScan, matched: Matched, judged: _Judged) -> OdometryStep:
        information, covariance = judged.information, judged.covariance
        weak = judged.weak or matched.lost or matched.doubtful
        substitute = ("wheels" if self.wheels.use.used else "motion") if weak else ""
        if weak:
            covariance = inflated(covariance, int(np.argmin(information[:2])), self._settings.weak_inflation)
        return OdometryStep(
            scan.stamp_ns,
            scan.stamp_ns + half_sweep_ns(scan),
            self._motion.pose,
            covariance,
            self._motion.velocity,
            information,
            matched.residual_m,
            matched.support,
            weak,
            substitute,
            True,
            matched.lost,
            self.wheels.use,
            self._error,
            not self.wheels.use.used and (matched.lost or matched.doubtful or self._errors.noise > _MOSTLY_NOISE),
        )

    def _blind(self, information: FloatArray) -> bool:
        """Return whether the heading is not observed well enough."""
        return 1.0 / math.sqrt(max(float(information[2]), 1e-12)) > math.radians(self._settings.weak_sigma_deg)

    def _weak(self, information: FloatArray) -> bool:
        """Return whether a direction or the heading is not observed well enough by this scan alone."""
        s = self._settings
        along, across = (1.0 / math.sqrt(max(value, 1e-12)) for value in information[:2].tolist())
        worse, better = max(along, across), min(along, across)
        one_sided = worse > s.weak_sigma_m and worse > s.weak_ratio * better
        return one_sided or worse > s.blind_sigma_m or self._blind(information)


def _planar_mount(T_level_sensor: FloatArray) -> FloatArray:
    """Return the scanner's planar pose (3,) in the level base frame."""
    return np.array(
        [T_level_sensor[0, 3], T_level_sensor[1, 3], math.atan2(T_level_sensor[1, 0], T_level_sensor[0, 0])]
    )
