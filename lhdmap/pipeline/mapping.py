"""The mapping pipeline: attitude, wheels, planar odometry and integration as stages of one stream of messages.

Scans wait until the inclinometer's filter has seen beyond them (a fixed delay), then go through the odometry; a sweep is
integrated once a later pose is known, so that its motion is interpolated and not guessed. Nothing here knows files.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from functools import partial
from typing import Literal

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se3
from lhdmap.machine import Machine
from lhdmap.messages import (
    FloatArray,
    Inclination,
    Joints,
    LaserScan,
    Message,
    Mount,
    PointCloud,
    Tachometer,
    WheelPose,
)
from lhdmap.odometry.cloud_motion import CloudPrior
from lhdmap.odometry.cloud_odometry import CloudOdometry, CloudStep
from lhdmap.odometry.planar import PlanarOdometry, View
from lhdmap.odometry.rear_view import RearView
from lhdmap.odometry.start import ScanInput, starting_velocity
from lhdmap.odometry.steps import OdometryStep, WheelStep
from lhdmap.pipeline.mounts import Mounts, level_sensor
from lhdmap.pipeline.path import FinalPath
from lhdmap.pipeline.pile import PileSink, PileWatch, PlacedScan
from lhdmap.pipeline.rear import RearScans
from lhdmap.pipeline.records import ScanRecords
from lhdmap.pipeline.sweep_times import SweepTimes
from lhdmap.pipeline.sweeps import ScanSink, SweepIntegration
from lhdmap.pipeline.track import Track
from lhdmap.proprioception.attitude import AttitudeFilter
from lhdmap.proprioception.slip import SlipEstimator
from lhdmap.proprioception.wheels import WheelOdometry
from lhdmap.scan_matching.scan_points import NO_BOXES, half_sweep_ns
from lhdmap.scan_matching.slant import rise_of
from lhdmap.smoothing.realign import AlignedScan
from lhdmap.smoothing.smoother import Smoother

_DEFAULT_MACHINE = Machine()
_WARM_SCANS, _FEWEST_WARM_SCANS, _WARM_NS = 50, 6, 1_500_000_000
_TILTED = 0.01  # rise of the scan plane ahead (m/m)
_PATIENCE_SCANS = 3  # after a pause of the whole log, wheels may come within as many scans before they count as silent
_QUEUE_SCANS = 2000  # a sensor that stops must not hold back scans without bound
_MOMENT_NS = 5_000_000
_EARLY = 10_000  # inclinations that wait for their mount at most


class MappingPipeline:
    """Takes messages by role in time order; `finish` ends the stream. Trajectory and cloud are there at any time.

    `primary`: the sensor that the odometry runs on, the front scanner or a 3D scanner; `cloud`: whether sweeps are integrated;
    `pile`: what looks for the pile, if not the stage of the settings here.
    """

    def __init__(
        self,
        settings: Settings,
        machine: Machine | None = None,
        on_sweep: ScanSink | None = None,
        primary: Literal["front", "points"] = "front",
        *,
        cloud: bool = True,
        pile: PileSink | None = None,
    ) -> None:
        self.settings = settings
        self.machine = machine
        self.mounts = Mounts(machine)
        self.attitude = AttitudeFilter(settings.attitude)
        self.wheels = WheelOdometry(settings.wheels, machine or _DEFAULT_MACHINE)
        self.slip = SlipEstimator(settings.slip, settings.wheels.scale_std)
        self.odometry: PlanarOdometry | None = None  # begins once the first scans have told the speed
        self.sweeps = SweepIntegration(settings, machine, self.mounts, on_sweep)
        self.clouds = CloudOdometry(settings.cloud_odometry) if primary == "points" else None
        self._primary = primary
        self.track = Track(settings.odometry.height_lever * (machine or _DEFAULT_MACHINE).dimensions.wheelbase_m)
        self.path = FinalPath(self.track)
        self.records = ScanRecords()
        self.smoother = Smoother(settings.smoothing)
        looked_for = primary == "front" and settings.pile.method != "off"
        self.pile: PileSink | None = (pile or PileWatch(settings)) if looked_for else None
        self._cloud = cloud
        self.rear = RearScans(self.mounts, self.wheels, machine or _DEFAULT_MACHINE)
        self.has_inclinometer = False
        self.wheel_sources: Counter[str] = Counter()  # scans that wheels told the motion of, by sensor
        self._newest_ns = self._time_ns = self._before_ns = -(2**62)
        self._clock_ns = -(2**62)
        self._scan_ns = (self._clock_ns, self._clock_ns)  # of the newest scan: its stamp, and that made rising
        self._disordered = False
        self._attitude_of: tuple[int, tuple[float, float]] = (-(2**63), (0.0, 0.0))
        self._sweep_times = SweepTimes()
        self._early: deque[Inclination] = deque(maxlen=_EARLY)  # until the first scan is processed
        self._waiting: deque[tuple[LaserScan | PointCloud, int]] = deque()
        self._boxes = own_boxes(machine, settings.integration.body_margin_m)

    def update(self, role: str, message: Message) -> None:
        """Take one message of the log."""
        if isinstance(message, (LaserScan, PointCloud)):
            message = self._sweep_times.checked(role, message)
        match message:
            case LaserScan() | PointCloud() if role == self._primary:
                self._disordered |= message.stamp_ns < self._newest_ns
                self._newest_ns = max(self._newest_ns, message.stamp_ns)
                self._scan_ns = message.stamp_ns, self._rising(message.stamp_ns)
                self._waiting.append((message, self._scan_ns[1]))
                self._process_ready()
            case LaserScan() | PointCloud():
                self._hold(role, message.stamp_ns, message)
                if isinstance(message, LaserScan) and role == "rear":
                    self.rear.hold(message)
            case Inclination():
                self._take_inclination(message)
            case Tachometer() | Joints():
                self.wheels.update(message)
            case WheelPose():
                self.wheels.update(message._replace(stamp_ns=self._beside_scan(message.stamp_ns)))
                self._process_ready()
            case Mount():
                self.mounts.update(message)
                self._mount_inclinometer()
            case _:
                pass

    def finish(self) -> None:
        """Say that the log has ended: what waits is processed with what there is."""
        self.attitude.finish()
        while self._waiting:
            self._process(*self._waiting.popleft())
        self.path.finish()
        self.sweeps.finish(self.path.final, self.wheels)

    @property
    def warnings(self) -> list[str]:
        """What the stages found odd, in words."""
        fused = self.odometry.wheels.warnings() if self.odometry is not None else []
        return [
            *self.mounts.warnings,
            *self.attitude.texts(),
            *self.wheels.warnings.texts(),
            *fused,
            *self._sweep_times.warnings,
        ]

    @property
    def drives_by_rear_body(self) -> bool:
        """Whether the scanner that the odometry uses sits on the rear body."""
        return self.mounts.on_rear_body(self._primary)

    def _take_inclination(self, message: Inclination) -> None:
        first, self.has_inclinometer = not self.has_inclinometer, True
        if self._time_ns < 0:
            self._early.append(message)
        if first:
            self._mount_inclinometer()
        else:
            self.attitude.update(message)

    def _mount_inclinometer(self) -> None:
        """Begin the attitude, with the inclinometer's mount if it is known; once more where that comes late."""
        if not self._early or self._time_ns > 0:  # what was used already stands
            return
        frame, R_base_sensor = self._early[0].frame_id, None
        if self.mounts.known(frame):
            R_base_sensor = self.mounts.of(frame, "inclinometer").T_parent_child[:3, :3]
        self.attitude = AttitudeFilter(self.settings.attitude, R_base_sensor)
        for message in self._early:
            self.attitude.update(message)

    def _process_ready(self) -> None:
        """Process the scans whose attitude and wheel motion later messages will not change."""
        paused = len(self._waiting) < _PATIENCE_SCANS and self._time_ns > 0
        ready_ns = self.wheels.ready_until_ns(self._newest_ns, self._time_ns if paused else None)
        if self.has_inclinometer:
            ready_ns = min(ready_ns, self.attitude.ready_until_ns(self._newest_ns))
        if self.clouds is None and self.odometry is None and not self._warm(ready_ns):
            return
        while self._waiting and (self._end_ns(0) <= ready_ns or len(self._waiting) > _QUEUE_SCANS):
            self._process(*self._waiting.popleft())

    def _warm(self, ready_ns: int) -> bool:
        """Return whether enough scans wait for the dry run that finds the starting speed."""
        waiting = self._waiting
        enough = len(waiting) >= _WARM_SCANS or (
            len(waiting) >= _FEWEST_WARM_SCANS and waiting[-1][1] - waiting[0][1] >= _WARM_NS
        )
        return enough and self._end_ns(min(_WARM_SCANS, len(waiting)) - 1) <= ready_ns

    def _end_ns(self, index: int) -> int:
        """Return the time for which a waiting scan needs attitude and wheels: the middle of its sweep."""
        scan, time_ns = self._waiting[index]
        return time_ns + (half_sweep_ns(scan) if isinstance(scan, LaserScan) else 0)

    def _begin(self, first: tuple[LaserScan | PointCloud, int]) -> PlanarOdometry:
        """Start the odometry with the speed that a dry run over the first scans finds."""
        waiting = [first, *list(self._waiting)[: _WARM_SCANS - 1]]
        inputs, before_ns = [], self._time_ns
        for scan, time_ns in waiting:
            if not isinstance(scan, LaserScan) or _says_nothing(scan, time_ns - before_ns):
                continue
            inputs.append(self._input(scan, before_ns, time_ns + half_sweep_ns(scan)))
            before_ns = time_ns + half_sweep_ns(scan)
        return self._odometry(starting_velocity(self._odometry, inputs))

    def _sees_again(self, scan: LaserScan, stamp_ns: int) -> bool:
        """Return whether front scans are to be realigned: tilted ones, with a rear scanner that sees their walls again."""
        tilted = abs(self.mounts.of(scan.frame_id, "front").T_parent_child[2, 0]) > _TILTED
        wanted = self._cloud and self.settings.smoothing.realign and self.settings.odometry.method == "anchored"
        return wanted and tilted and self.has_inclinometer and self.rear.near(stamp_ns, 0.0, 0.0) is not None

    def _odometry(self, velocity: FloatArray | None) -> PlanarOdometry:
        s = self.settings
        return PlanarOdometry(s.odometry, s.anchor, s.search, s.range_flow, velocity)

    def _rising(self, stamp_ns: int) -> int:
        """Return a stamp that never runs backwards once stamps of scans did: the order of the log then tells more."""
        if self._disordered:
            stamp_ns = max(stamp_ns, self._clock_ns + 1)
        self._clock_ns = max(self._clock_ns, stamp_ns)
        return stamp_ns

    def _beside_scan(self, stamp_ns: int) -> int:
        """Return the stamp of a wheel pose, made rising; one that came with a scan stays with it."""
        return self._scan_ns[1] if stamp_ns == self._scan_ns[0] else self._rising(stamp_ns)

    def _process(self, scan: LaserScan | PointCloud, stamp_ns: int) -> None:
        """Run one scan of the primary scanner through all stages; `stamp_ns` is its stamp made rising."""
        if isinstance(scan, PointCloud):
            if self.clouds is not None:
                self._process_cloud(self.clouds, scan, stamp_ns)
            return
        in_bunches = self.odometry is not None and self.odometry.clock.bunched
        if _says_nothing(scan, stamp_ns - self._before_ns) and not (in_bunches and scan.ranges_m.size):
            self.records.add_scan(scan.stamp_ns, max(stamp_ns, self._time_ns + 1))
            return
        self._before_ns = stamp_ns
        if self.odometry is None:
            self.odometry = self._begin((scan, stamp_ns))
            if self._sees_again(scan, stamp_ns):
                self.path.realign(
                    self.settings.smoothing, -(self.machine or _DEFAULT_MACHINE).dimensions.joint_to_front_axle_m
                )
        time_ns = max(stamp_ns + half_sweep_ns(scan), self._time_ns + 1)
        step = self.odometry.update(*self._input(scan, self._time_ns, time_ns))
        self._time_ns = time_ns
        self._early.clear()
        self.records.add_scan(scan.stamp_ns, stamp_ns)
        self._hold("front", stamp_ns, scan)
        if step.processed:
            self.track.append(time_ns, step.T_odom_base, *self._attitude_at(time_ns))
            front, rear = self.odometry.points, self.odometry.points_behind
            self.smoother.keys.update(time_ns, step.T_odom_base, front, weak=step.degenerate)
            self.path.update(AlignedScan(time_ns, step.T_odom_base, front, rear, weak=step.lost))
            self._record(scan.stamp_ns, time_ns, step)
            self._look_for_pile(scan, time_ns, step)
            self.sweeps.advance(self.path.final, self.wheels)

    def _look_for_pile(self, scan: LaserScan, time_ns: int, step: OdometryStep) -> None:
        if self.pile is not None and self.has_inclinometer:
            x, y, heading = step.T_odom_base
            pose = np.array([x, y, self.track.height_m, heading])
            self.pile.update(PlacedScan(scan, self._placement(scan, time_ns), step.velocity, self._boxes, pose))

    def _hold(self, role: str, time_ns: int, sweep: LaserScan | PointCloud) -> None:
        if self._cloud:
            self.sweeps.hold(role, time_ns, sweep)

    def _process_cloud(self, odometry: CloudOdometry, cloud: PointCloud, stamp_ns: int) -> None:
        """Run one cloud of a 3D scanner through all stages."""
        time_ns = max(stamp_ns, self._time_ns + 1)
        motion = self.wheels.motion_between(self._time_ns, time_ns) if self._time_ns > 0 else None
        prior = None
        if motion is not None:
            self.wheel_sources[motion.source] += 1
            x, y, turn = (float(value) for value in motion.delta)
            prior = CloudPrior(se3.from_rpy(0.0, 0.0, turn, (x, y, 0.0)), motion.covariance)
        T_level_base = se3.from_rpy(*self._attitude_at(time_ns), 0.0) if self.has_inclinometer else None
        T_base_sensor = self.mounts.of(cloud.frame_id, "points").T_parent_child
        step = odometry.update(cloud._replace(stamp_ns=time_ns), T_base_sensor, prior, T_level_base, self._boxes)
        self._time_ns = time_ns
        self.records.add_scan(cloud.stamp_ns, time_ns)
        self._hold("points", time_ns, cloud)
        if step.processed:
            self.track.append_space(time_ns, step.T_odom_base)
            self._record(cloud.stamp_ns, time_ns, step)
            self.sweeps.advance(self.track, self.wheels)

    def _input(self, scan: LaserScan, before_ns: int, time_ns: int) -> ScanInput:
        """Return a scan with all that is known of the machine at `time_ns`, the middle of its sweep."""
        rear = partial(self._behind, time_ns) if self.has_inclinometer else None
        rise = rise_of(self.mounts.of(scan.frame_id, "front").T_parent_child)
        view = View(self.track.height_m, self._boxes, rear, rise)
        return ScanInput(scan, partial(self._placement, scan, time_ns), self._wheel_step(before_ns, time_ns), view)

    def _placement(self, scan: LaserScan, time_ns: int) -> FloatArray:
        """Return `T_level_sensor` (4, 4) of the front scanner."""
        return level_sensor(self.mounts.of(scan.frame_id, "front"), *self._attitude_at(time_ns))

    def _behind(self, time_ns: int) -> RearView | None:
        return self.rear.near(time_ns, *self._attitude_at(time_ns))

    def _attitude_at(self, time_ns: int) -> tuple[float, float]:
        """Return roll and pitch; a log without inclinometer counts as level."""
        if self._attitude_of[0] != time_ns:  # a scan asks twice, and the filter fits anew each time
            known = self.attitude.roll_pitch_at(time_ns) if self.has_inclinometer else (0.0, 0.0)
            self._attitude_of = (time_ns, known)
        return self._attitude_of[1]

    def _wheel_step(self, before_ns: int, time_ns: int) -> WheelStep | None:
        """Return the wheels' motion since the scan before, as far as the sensors tell."""
        motion = self.wheels.motion_between(before_ns, time_ns) if before_ns > 0 else None
        if motion is None:
            return None
        self.wheel_sources[motion.source] += 1
        forward_sigma, turn_sigma = math.sqrt(motion.covariance[0, 0]), math.sqrt(motion.covariance[2, 2])
        turn = None if motion.source == "tachometer" else float(motion.delta[2])
        half = 0.5 * float(motion.delta[2])  # the way's direction is the heading's in the middle of the step
        forward_m = math.cos(half) * float(motion.delta[0]) + math.sin(half) * float(motion.delta[1])
        return WheelStep(forward_m, forward_sigma, turn, turn_sigma)

    def _record(self, stamp_ns: int, time_ns: int, step: OdometryStep | CloudStep) -> None:
        wheel_mps = self.wheels.speed_at(time_ns)
        speed_mps = float(step.velocity[0])
        slip = math.nan
        if wheel_mps is not None:
            slip = self.slip.update(time_ns, wheel_mps, speed_mps)
        match_ = (step.residual_m, step.support)
        self.records.add_processed(
            stamp_ns, match_, step.information, step.substitute, (step.degenerate, step.lost), slip
        )
        self.records.add_motion(time_ns, speed_mps, wheel_mps, self.wheels.articulation_at(time_ns))


def _says_nothing(scan: LaserScan, after_ns: int) -> bool:
    """Return whether a scan is none: without beams, or without a hit a moment after another one."""
    return not scan.ranges_m.size or (after_ns < _MOMENT_NS and not bool((scan.ranges_m < scan.range_max_m).any()))


def own_boxes(machine: Machine | None, margin_m: float) -> FloatArray:
    """Return the boxes of the front body with a margin, shape (K, 6), for scans of the front scanner."""
    if machine is None:
        return NO_BOXES
    boxes = machine.boxes("base_link").reshape(-1, 6).copy()
    boxes[:, :3] -= margin_m
    boxes[:, 3:] += margin_m
    return boxes
