"""Planar motion of `base_link` from wheels and articulation, with its covariance.

Two sources, the better one first: tachometer and articulation angle through Eq. (1)-(2) of the paper (theta is the
heading of the FRONT body, v the speed of the front axle; the errata confirm the equations as printed), or differences
of the machine's own dead reckoning. The tachometer alone gives the distance, with the heading all but unknown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Joints, Tachometer, WheelPose
from lhdmap.proprioception.articulated import covered, integrate_motion, interpolate, motion_covariance
from lhdmap.proprioception.samples import SampleBuffer, Warnings
from lhdmap.settings import setting

Source = Literal["articulated", "wheel_pose", "tachometer"]


@dataclass(frozen=True, slots=True)
class WheelSettings:
    """Wheel odometry: what is believed of tachometer, articulation and dead reckoning."""

    scale_std: float = setting(
        0.02, minimum=0.0, maximum=1.0, doc="Scale error of the tachometer before it is calibrated, standard deviation."
    )
    speed_std_mps: float = setting(0.03, unit="m/s", minimum=0.0, doc="Noise of the tachometer.")
    side_slip_std: float = setting(0.01, unit="m/m", minimum=0.0, doc="Sideways slip for each metre driven.")
    articulation_std_deg: float = setting(
        0.5, unit="deg", minimum=0.0, doc="Error of the articulation angle: its offset, play and side slip in bends."
    )
    articulation_noise_deg: float = setting(
        0.1, unit="deg", minimum=0.0, doc="Noise of single articulation angles, which turns the front body."
    )
    unknown_articulation_deg: float = setting(
        15.0, unit="deg", minimum=0.0, doc="The same where the log has no articulation."
    )
    pose_distance_std: float = setting(0.05, unit="m/m", minimum=0.0, doc="Dead reckoning: error of each metre driven.")
    pose_turn_std: float = setting(
        0.05, unit="rad/rad", minimum=0.0, doc="Dead reckoning: error of each radian turned."
    )
    pose_drift_deg: float = setting(
        1.0, unit="deg/m", minimum=0.0, doc="Dead reckoning: heading error for each metre driven."
    )
    max_gap_s: float = setting(0.5, unit="s", minimum=0.01, doc="Across a longer gap there is no motion.")
    max_hold_s: float = setting(0.2, unit="s", minimum=0.0, doc="The last samples stand for this long after them.")
    max_speed_mps: float = setting(15.0, unit="m/s", minimum=0.1, doc="A faster machine is an error of the sensor.")
    max_jump_m: float = setting(1.0, unit="m", minimum=0.0, doc="Dead reckoning may jump by this whatever the speed.")
    keep_s: float = setting(60.0, unit="s", minimum=1.0, doc="Samples are kept for this long.")


class Motion(NamedTuple):
    """Planar motion of `base_link`: `delta` (x, y, heading) in the frame at its start, `covariance` (3, 3); m, rad."""

    delta: FloatArray
    covariance: FloatArray
    source: Source


class WheelOdometry:
    """Takes tachometer, joints and wheel poses in the order of the log; gives the motion between any two times kept."""

    def __init__(self, settings: WheelSettings, machine: Machine) -> None:
        self.settings = settings
        self.warnings = Warnings()
        self.scale, self.scale_std = 1.0, settings.scale_std
        size = machine.dimensions
        self._lengths = (size.joint_to_front_axle_m, size.joint_to_rear_axle_m)
        self._max_articulation_rad = math.radians(size.max_articulation_deg) + 0.2
        keep_s = settings.keep_s
        self._speeds = SampleBuffer("tachometer", 1, keep_s, self.warnings)
        self._angles = SampleBuffer("articulation", 1, keep_s, self.warnings)
        self._poses = SampleBuffer("wheel odometry", 4, keep_s, self.warnings)  # x, y, heading, number of the stretch
        self._stretch = 0
        self._gap_ns, self._hold_ns = round(settings.max_gap_s * 1e9), round(settings.max_hold_s * 1e9)

    def update(self, message: Tachometer | Joints | WheelPose) -> None:
        """Take one message; values that cannot be are left out, with a warning."""
        if isinstance(message, Tachometer):
            self._take_speed(message)
        elif isinstance(message, Joints):
            self._take_joints(message)
        else:
            self._take_pose(message)

    def calibrate(self, scale: float, scale_std: float) -> None:
        """Set the factor from the tachometer's speed to the machine's, as `SlipEstimator` learns it."""
        self.scale, self.scale_std = scale, scale_std

    def speed_at(self, stamp_ns: int) -> float | None:
        """Return the tachometer's speed as it was measured (m/s, not calibrated), or None where there is none."""
        if not self._covers(self._speeds, stamp_ns, stamp_ns):
            return None
        return float(interpolate(self._speeds.stamps_ns, self._speeds.rows[:, 0], stamp_ns))

    def articulation_at(self, stamp_ns: int) -> float | None:
        """Return the articulation angle (rad), or None where there is none."""
        if not self._covers(self._angles, stamp_ns, stamp_ns):
            return None
        return float(interpolate(self._angles.stamps_ns, self._angles.rows[:, 0], stamp_ns))

    def motion_between(self, start_ns: int, end_ns: int) -> Motion | None:
        """Return the motion between two times, or None where no sensor covers them or `end_ns` is earlier."""
        if end_ns < start_ns:
            return None
        speeds = self._covers(self._speeds, start_ns, end_ns)
        angles = self._covers(self._angles, start_ns, end_ns)
        if speeds and angles:
            return self._driven(start_ns, end_ns, "articulated")
        if self._covers(self._poses, start_ns, end_ns):
            motion = self._reckoned(start_ns, end_ns)
            if motion is not None:
                return motion
        return self._driven(start_ns, end_ns, "tachometer") if speeds else None

    def _take_speed(self, message: Tachometer) -> None:
        if abs(message.speed_mps) > self.settings.max_speed_mps:
            self.warnings.add(f"tachometer: more than {self.settings.max_speed_mps:g} m/s; left out")
            return
        self._speeds.append(message.stamp_ns, (message.speed_mps,))

    def _take_joints(self, message: Joints) -> None:
        angle = message.positions_rad.get("articulation")
        if angle is None:
            return
        if abs(angle) > self._max_articulation_rad:
            self.warnings.add(
                "articulation: an angle beyond what the machine can bend; left out (degrees, not radians?)"
            )
            return
        self._angles.append(message.stamp_ns, (angle,))

    def _take_pose(self, message: WheelPose) -> None:
        last_ns, last = self._poses.latest_ns, self._poses.latest_row
        if last_ns is not None and message.stamp_ns > last_ns:
            moved_m = math.hypot(message.x_m - last[0], message.y_m - last[1])
            allowed_m = self.settings.max_jump_m + self.settings.max_speed_mps * (message.stamp_ns - last_ns) / 1e9
            if moved_m > allowed_m:
                self._stretch += 1
                self.warnings.add("wheel odometry: it jumps; no motion is taken across the jump")
        self._poses.append(message.stamp_ns, (message.x_m, message.y_m, message.heading_rad, float(self._stretch)))

    def _covers(self, samples: SampleBuffer, start_ns: int, end_ns: int) -> bool:
        """Return whether samples go from start to end without a long gap (the last one may be held for a while)."""
        return bool(covered(samples.stamps_ns, (start_ns, end_ns), self._gap_ns, self._hold_ns))

    def _driven(self, start_ns: int, end_ns: int, source: Source) -> Motion:
        L_f, L_r = self._lengths
        speeds, angles = self._speeds, self._angles
        if source == "articulated":
            angle_stamps, angle_rows = angles.stamps_ns, angles.rows[:, 0]
        else:  # straight on
            angle_stamps, angle_rows = np.zeros(1, dtype=np.int64), np.zeros(1)
        delta, path_m, lever = integrate_motion(
            (speeds.stamps_ns, speeds.rows[:, 0] * self.scale),
            (angle_stamps, angle_rows),
            (start_ns, end_ns),
            (L_f, L_r),
        )
        settings = self.settings
        error_deg = settings.articulation_std_deg if source == "articulated" else settings.unknown_articulation_deg
        noise_rad = math.sqrt(2.0) * math.radians(settings.articulation_noise_deg) * L_r / (L_f + L_r)
        heading = math.hypot(lever * math.radians(error_deg), noise_rad)
        along = math.hypot(self.scale_std * path_m, settings.speed_std_mps * (end_ns - start_ns) / 1e9)
        return Motion(delta, motion_covariance(along, settings.side_slip_std * path_m, heading, delta), source)

    def _reckoned(self, start_ns: int, end_ns: int) -> Motion | None:
        """Return the difference of two wheel poses, or None across a jump."""
        settings = self.settings
        start, end = self._pose_at(start_ns), self._pose_at(end_ns)
        if start is None or end is None or start[3] != end[3]:
            return None
        delta = se2.between(start[:3], end[:3])
        path_m = math.hypot(delta[0], delta[1])
        heading = math.hypot(settings.pose_turn_std * delta[2], math.radians(settings.pose_drift_deg) * path_m)
        floor_m = 1e-3  # resolution of the poses in logs
        along = math.hypot(settings.pose_distance_std * path_m, floor_m)
        return Motion(delta, motion_covariance(along, along, math.hypot(heading, 1e-3), delta), "wheel_pose")

    def _pose_at(self, stamp_ns: int) -> FloatArray | None:
        """Return x, y, heading and stretch at a time, carried on from the last two where it is later; shape (4,)."""
        stamps, rows = self._poses.stamps_ns, self._poses.rows
        after = min(max(int(np.searchsorted(stamps, stamp_ns)), 1), len(stamps) - 1)
        if len(stamps) == 1:
            return rows[0].copy()
        before, following = rows[after - 1], rows[after]
        if stamp_ns == stamps[after]:
            return following.copy()
        if stamp_ns == stamps[after - 1]:
            return before.copy()
        if before[3] != following[3]:
            return None
        share = (stamp_ns - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
        step = following - before
        step[2] = se2.wrap(step[2])
        return before + share * step
