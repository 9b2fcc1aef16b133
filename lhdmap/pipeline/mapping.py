"""The mapping pipeline: attitude, wheels, planar odometry and integration as stages of one stream of messages.

    message -> ScanOrder -> ScanQueue -> FrontEnd.input -> PlanarOdometry -> Track, FinalPath -> SweepIntegration -> cloud

Scans wait until the inclinometer's filter has seen beyond them (a fixed delay), then go through the odometry; a sweep is
integrated once a later pose is known, so that its motion is interpolated and not guessed. Nothing here knows files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from types import TracebackType
from typing import Literal, NamedTuple, Self

import numpy as np

from lhdmap.config import Settings
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, Message, PointCloud, Text, WheelPose
from lhdmap.odometry.anchored.rear_view import behind
from lhdmap.odometry.cloud.odometry import CloudOdometry
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.start import starting_velocity
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.evidence import DriveEvidence
from lhdmap.pipeline.front_end import FrontEnd
from lhdmap.pipeline.path import FinalPath
from lhdmap.pipeline.pile import PileSink, PileWatch, PlacedScan
from lhdmap.pipeline.pose_now import PoseNow, pose_now
from lhdmap.pipeline.records import ScanRecords
from lhdmap.pipeline.scan_order import TimedScan, WaitingScans, says_nothing
from lhdmap.pipeline.step_recorder import StepRecorder
from lhdmap.pipeline.sweeps import ScanSink, SweepIntegration
from lhdmap.pipeline.track import Track
from lhdmap.smoothing.realign import AlignedScan

# A view of the drift: beams of the rear scanner that its free space needs, and how old its scan may be (six periods at 50 Hz).
_VIEW_BEAMS, _VIEW_NS = 400, 120_000_000
_CLOCKS = ("inclinometer", "tachometer", "joints")


StepSink = Callable[[int, OdometryStep, PlanarOdometry], None]
"""Takes each front scan's stamp, what the odometry says of it, and the odometry with the hits of the last processed one."""


class MappingOptions(NamedTuple):
    """How a `MappingPipeline` runs.

    `primary`: the sensor that the odometry runs on, the front scanner or a 3D scanner; `cloud`: whether sweeps are integrated,
    and `on_sweep` is told of each; `pile`: what looks for the pile, if not the stage of the settings here; `worker`: integrates
    sweeps, a thread of its own by default; `on_step`: is told of each front scan. `kept`: whether the drive is kept for what comes
    after it (rows, path, key scans); a machine that runs for a shift has no use for it.
    """

    primary: Literal["front", "points"] = "front"
    cloud: bool = True
    on_sweep: ScanSink | None = None
    pile: PileSink | None = None
    worker: Executor | None = None
    on_step: StepSink | None = None
    kept: bool = True


_WHOLE = MappingOptions()


class MappingPipeline:
    """Takes messages by role in time order; `finish` ends the stream. Trajectory and cloud are there at any time.

    A context manager: left by an error, it lets go of what it holds.
    """

    def __init__(self, settings: Settings, machine: Machine | None = None, options: MappingOptions = _WHOLE) -> None:
        self.settings, self.machine, self._options = settings, machine, options
        self.front_end = front = FrontEnd(settings, machine)
        self._waiting = WaitingScans()
        self.odometry: PlanarOdometry | None = None  # begins once the first scans have told the speed
        self.clouds = CloudOdometry(settings.cloud_odometry) if options.primary == "points" else None
        lever_m = settings.odometry.height_lever * front.machine.dimensions.wheelbase_m
        self.path = FinalPath(Track(lever_m, kept=options.kept))
        self.sweeps = SweepIntegration(settings, machine, front.mounts, options.on_sweep, options.worker)
        self.evidence = DriveEvidence(settings.smoothing)
        looked_for = options.primary == "front" and settings.pile.method != "off"
        self.pile: PileSink | None = (options.pile or PileWatch(settings)) if looked_for else None
        self._steps = StepRecorder(front.wheels, settings.slip, kept=options.kept)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of the worker, whatever happened."""
        self.sweeps.close()

    def update(self, role: str, message: Message) -> None:
        """Take one message of the log."""
        if isinstance(message, (LaserScan, PointCloud)):
            message = self.front_end.sweep_times.checked(role, message)
            if role == self._options.primary:
                if self._waiting.is_late(message):
                    return
                self._waiting.append(message)
                self._process_ready()
                return
            self._hold(role, message.stamp_ns, message)
        if isinstance(message, WheelPose):
            self.front_end.update(role, message._replace(stamp_ns=self._waiting.order.of_wheels(message.stamp_ns)))
            self._process_ready()
            return
        if isinstance(message, Text):
            if role == "node":
                self.evidence.say(self._waiting.order.newest_ns, message.text)  # a text has no stamp of its own
            return
        if role in _CLOCKS:
            self._waiting.overdue.hear(message.stamp_ns)
        self.front_end.update(role, message)

    def finish(self) -> None:
        """Say that the log has ended: what waits is processed with what there is."""
        self.front_end.inclinometer.attitude.finish()
        while len(self._waiting.queue):
            self._process(self._waiting.queue.pop())
        self.path.finish()
        self.sweeps.finish(self.path.final, self.front_end.wheels)

    def pose_at(self, now_ns: int) -> PoseNow | None:
        """Return where the machine is now, as far as the newest processed scan and the sensors since tell; None before the first.

        The track is late by what the inclinometer's filter waits for. This extrapolates from its last pose by wheels and joint,
        or by the last motion, with the attitude of now.
        """
        if self.track.last_ns is None:
            return None
        return pose_now(now_ns, self.track, self._steps.newest, self.front_end, self.settings.odometry)

    @property
    def warnings(self) -> list[str]:
        """What the stages found odd, in words."""
        if self.odometry is None:
            return self.front_end.warnings
        gyro = self.odometry.gyro.warning()
        return [
            *self.front_end.warnings,
            *self._waiting.overdue.warnings(),
            *self.odometry.wheels.warnings(),
            *([] if gyro is None else [gyro]),
            *self.evidence.told,
        ]

    @property
    def track(self) -> Track:
        """The path by odometry alone."""
        return self.path.track

    @property
    def records(self) -> ScanRecords:
        """A few numbers of each scan, for tables and curves."""
        return self._steps.records

    @property
    def has_inclinometer(self) -> bool:
        """Whether an inclinometer has told the attitude."""
        return self.front_end.has_inclinometer

    @property
    def drives_by_rear_body(self) -> bool:
        """Whether the scanner that the odometry uses sits on the rear body."""
        return self.front_end.mounts.on_rear_body(self._options.primary)

    def _process_ready(self) -> None:
        """Process the scans whose attitude and wheel motion later messages will not change."""
        waiting = self._waiting
        ready_ns = self.front_end.ready_until_ns(waiting.order.newest_ns, waiting.judged_ns)
        if self.clouds is None and self.odometry is None and not waiting.queue.is_warm(ready_ns):
            return
        while waiting.queue.is_ready(ready_ns):
            self._process(waiting.queue.pop())

    def _process(self, one: TimedScan) -> None:
        """Run one scan of the primary scanner through all stages."""
        if isinstance(one.scan, PointCloud):
            if self.clouds is not None:
                self._process_cloud(self.clouds, one.scan, one.stamp_ns)
            return
        scan, stamp_ns, waiting = one.scan, one.stamp_ns, self._waiting
        in_bunches = self.odometry is not None and self.odometry.clock.bunched
        if says_nothing(scan, stamp_ns - waiting.said_ns) and not (in_bunches and scan.ranges_m.size):
            self.records.add_scan(scan.stamp_ns, max(stamp_ns, waiting.used_ns + 1))
            return
        waiting.said_ns = stamp_ns
        odometry = self.odometry or self._begin(one)
        time_ns = waiting.rising(one.time_ns)
        step = odometry.update(*self.front_end.input(scan, waiting.used_ns, time_ns, self.track.height_m))
        self._use(time_ns)
        self.records.add_scan(scan.stamp_ns, stamp_ns)
        self._hold("front", stamp_ns, scan)
        if step.processed:
            self._take(scan, time_ns, step, odometry)
        if self._options.on_step is not None:
            self._options.on_step(scan.stamp_ns, step, odometry)

    def _use(self, time_ns: int) -> None:
        """Note that the scans up to a time are used."""
        self._waiting.used_ns = time_ns
        self.front_end.inclinometer.begin()

    def _take(self, scan: LaserScan, time_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Hand a processed scan on to all that live by its pose."""
        front = self.front_end
        self.track.append(time_ns, step.pose_odom_base, *front.inclinometer.roll_pitch_at(time_ns))
        self._steps.believe(step, odometry)
        if self._options.kept:
            self._keep(scan, time_ns, step, odometry)
        aligned = AlignedScan(time_ns, step.pose_odom_base, odometry.points, odometry.points_behind, weak=step.lost)
        self.path.update(aligned)
        self._steps.record(scan.stamp_ns, time_ns, step, odometry)
        self._look_for_pile(scan, time_ns, step)
        self.sweeps.advance(self.path.final, front.wheels)

    def _keep(self, scan: LaserScan, time_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Keep what the steps after the drive live by: turns, key scans, views."""
        gyro, evidence = self.front_end.inclinometer.gyro, self.evidence
        if gyro.there:
            evidence.turns.append(time_ns, gyro.turned_at(np.array([time_ns]))[0])
        evidence.smoother.keys.update(time_ns, step.pose_odom_base, odometry.points, step.error, unseen=step.unseen)
        self._view(scan, time_ns, step, odometry)

    def _view(self, scan: LaserScan, time_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Keep what both scanners saw, where the views want it."""
        height_m, views = self.track.height_m, self.evidence.views
        if not self._options.cloud or not views.wants(step.pose_odom_base, height_m):
            return
        front = odometry.points - [0.0, 0.0, height_m]
        fans = [(self.front_end.placement(scan, time_ns)[:2, 3], front)]
        rear = self.front_end.behind_at(time_ns, _VIEW_NS)
        if rear is not None:
            floor_m = self.settings.odometry.min_height_m
            fans.append((rear.T_level_sensor[:2, 3], behind(rear, step.velocity, 0.0, floor_m, _VIEW_BEAMS).points))
        views.add(time_ns, fans)

    def _begin(self, one: TimedScan) -> PlanarOdometry:
        """Start the odometry with the speed that a dry run over the first scans finds; realign its scans where that helps."""
        inputs, before_ns = [], self._waiting.used_ns
        for scan, stamp_ns in [one, *self._waiting.queue.first()]:
            if not isinstance(scan, LaserScan) or says_nothing(scan, stamp_ns - before_ns):
                continue
            time_ns = TimedScan(scan, stamp_ns).time_ns
            inputs.append(self.front_end.input(scan, before_ns, time_ns, self.track.height_m))
            before_ns = time_ns
        self.odometry = odometry = self._odometry(starting_velocity(self._odometry, inputs))
        odometry.clock.expect([one.scan.stamp_ns for one in inputs])
        s = self.settings
        wanted = self._options.cloud and s.smoothing.realign and s.odometry.method == "anchored"
        if wanted and isinstance(one.scan, LaserScan) and self.front_end.sees_again(one.scan, one.stamp_ns):
            self.path.realign(s.smoothing, -self.front_end.machine.dimensions.joint_to_front_axle_m)
        return odometry

    def _odometry(self, velocity: FloatArray | None) -> PlanarOdometry:
        s = self.settings
        return PlanarOdometry(s.odometry, s.anchor, s.search, s.range_flow, velocity, s.trust)

    def _look_for_pile(self, scan: LaserScan, time_ns: int, step: OdometryStep) -> None:
        if self.pile is not None and self.has_inclinometer:
            x, y, heading = step.pose_odom_base
            pose, placement = np.array([x, y, self.track.height_m, heading]), self.front_end.placement(scan, time_ns)
            self.pile.update(PlacedScan(scan, placement, step.velocity, self.front_end.boxes, pose))

    def _hold(self, role: str, time_ns: int, sweep: LaserScan | PointCloud) -> None:
        if self._options.cloud:
            self.sweeps.hold(role, time_ns, sweep)

    def _process_cloud(self, odometry: CloudOdometry, cloud: PointCloud, stamp_ns: int) -> None:
        """Run one cloud of a 3D scanner through all stages."""
        time_ns = self._waiting.rising(stamp_ns)
        T_base_sensor, prior, T_level_base = self.front_end.cloud_input(cloud, self._waiting.used_ns, time_ns)
        step = odometry.update(
            cloud._replace(stamp_ns=time_ns), T_base_sensor, prior, T_level_base, self.front_end.boxes
        )
        self._use(time_ns)
        self.records.add_scan(cloud.stamp_ns, time_ns)
        self._hold("points", time_ns, cloud)
        if step.processed:
            self.track.append_space(time_ns, step.T_odom_base)
            self._steps.believe_cloud(step)
            self._steps.record(cloud.stamp_ns, time_ns, step, None)
            self.sweeps.advance(self.track, self.front_end.wheels)


def feed(pipeline: MappingPipeline, messages: Iterable[tuple[str, Message]]) -> MappingPipeline:
    """Send all messages (role, message) through a pipeline, finish it and return it."""
    with pipeline:
        for role, message in messages:
            pipeline.update(role, message)
        pipeline.finish()
    return pipeline
