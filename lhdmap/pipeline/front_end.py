"""What a scan needs to know of the machine: mounts, attitude, wheels, joint and the rear scanner, from messages to `ScanInput`."""

from __future__ import annotations

import math
from collections import Counter
from functools import partial

from lhdmap.config import Settings
from lhdmap.geometry import se3
from lhdmap.geometry.boxes import grown
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
from lhdmap.odometry.anchored.rear_view import RearView
from lhdmap.odometry.cloud.motion import CloudPrior
from lhdmap.odometry.planar import ScanView
from lhdmap.odometry.start import ScanInput
from lhdmap.odometry.steps import WheelStep
from lhdmap.pipeline.inclinometer import AttitudeSource
from lhdmap.pipeline.mounts import SensorMounts, level_sensor
from lhdmap.pipeline.rear import AT_ONCE_NS, RearScans
from lhdmap.pipeline.sweep_times import SweepTimes
from lhdmap.proprioception.wheels import WheelOdometry
from lhdmap.scan_matching.scan_points import NO_BOXES
from lhdmap.scan_matching.slant import rise_of

DEFAULT_MACHINE = Machine()
_TILTED = 0.01  # rise of the scan plane ahead (m/m)


class FrontEnd:
    """Takes the messages of all sensors but the primary scanner; tells what holds at the time of a scan."""

    def __init__(self, settings: Settings, machine: Machine | None) -> None:
        self.machine = machine or DEFAULT_MACHINE
        self.mounts = SensorMounts(machine)
        self.inclinometer = AttitudeSource(settings.attitude, settings.gyro, self.mounts)
        self.wheels = WheelOdometry(settings.wheels, self.machine)
        self.rear = RearScans(self.mounts, self.wheels, self.machine)
        self.sweep_times = SweepTimes()
        self.boxes = own_boxes(machine, settings.integration.body_margin_m)
        self.wheel_sources: Counter[str] = Counter()  # scans that wheels told the motion of, by sensor

    def update(self, role: str, message: Message) -> None:
        """Take a message of any sensor but the primary scanner."""
        match message:
            case LaserScan() if role == "rear":
                self.rear.hold(message)
            case Inclination():
                self.inclinometer.update(message)
            case Tachometer() | Joints() | WheelPose():
                self.wheels.update(message)
            case Mount():
                self.mounts.update(message)
                self.inclinometer.mount()
            case _:
                pass

    def ready_until_ns(self, newest_ns: int, judged_ns: int | None) -> int:
        """Return the latest time whose attitude and wheel motion later messages will not change."""
        ready_ns = self.wheels.ready_until_ns(newest_ns, judged_ns)
        return (
            min(ready_ns, self.inclinometer.attitude.ready_until_ns(newest_ns)) if self.has_inclinometer else ready_ns
        )

    def input(self, scan: LaserScan, before_ns: int, time_ns: int, height_m: float) -> ScanInput:
        """Return a scan with all that is known of the machine at `time_ns`, the middle of its sweep."""
        rear = partial(self.behind_at, time_ns) if self.has_inclinometer else None
        rise = rise_of(self.mounts.of(scan.frame_id, "front").T_parent_child)
        gyro = self.inclinometer.gyro
        turn_rad = gyro.turn_between(before_ns, time_ns) if gyro.there else None
        view = ScanView(height_m, self.boxes, rear, rise, self.has_inclinometer, turn_rad)
        return ScanInput(scan, partial(self.placement, scan, time_ns), self._wheel_step(before_ns, time_ns), view)

    def placement(self, scan: LaserScan, time_ns: int) -> FloatArray:
        """Return `T_level_sensor` (4, 4) of the front scanner."""
        return level_sensor(self.mounts.of(scan.frame_id, "front"), *self.inclinometer.roll_pitch_at(time_ns))

    def cloud_input(
        self, cloud: PointCloud, before_ns: int, time_ns: int
    ) -> tuple[FloatArray, CloudPrior | None, FloatArray | None]:
        """Return the mount of a 3D scanner (4, 4), the wheels' motion since the cloud before, and the attitude (4, 4)."""
        motion = self.wheels.motion_between(before_ns, time_ns) if before_ns > 0 else None
        prior = None
        if motion is not None:
            x, y, turn = (float(value) for value in motion.delta)
            prior = CloudPrior(se3.from_rpy(0.0, 0.0, turn, (x, y, 0.0)), motion.covariance)
        T_level_base = se3.from_rpy(*self.inclinometer.roll_pitch_at(time_ns), 0.0) if self.has_inclinometer else None
        return self.mounts.of(cloud.frame_id, "points").T_parent_child, prior, T_level_base

    def sees_again(self, scan: LaserScan, stamp_ns: int) -> bool:
        """Return whether a front scan is tilted, with a rear scanner that sees its walls again at the same height."""
        tilted = abs(self.mounts.of(scan.frame_id, "front").T_parent_child[2, 0]) > _TILTED
        return tilted and self.has_inclinometer and self.rear.near(stamp_ns, 0.0, 0.0) is not None

    @property
    def has_inclinometer(self) -> bool:
        """Whether an inclinometer has told the attitude."""
        return self.inclinometer.there

    @property
    def warnings(self) -> list[str]:
        """What was odd in the sensors, in words."""
        return [
            *self.mounts.warnings,
            *self.inclinometer.attitude.texts(),
            *self.inclinometer.gyro.texts(),
            *self.wheels.warnings.texts(),
            *self.sweep_times.warnings,
        ]

    def behind_at(self, time_ns: int, within_ns: int = AT_ONCE_NS) -> RearView | None:
        """Return what the rear scanner saw at `time_ns`, None where it saw nothing `within_ns` or the joint is not known."""
        return self.rear.near(time_ns, *self.inclinometer.roll_pitch_at(time_ns), within_ns)

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


def own_boxes(machine: Machine | None, margin_m: float) -> FloatArray:
    """Return the boxes of the front body with a margin, shape (K, 6), for scans of the front scanner."""
    if machine is None:
        return NO_BOXES
    return grown(machine.boxes("base_link"), margin_m)
