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
import numpy.typing as npt

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Joints, Tachometer, WheelPose
from lhdmap.proprioception.articulated import DriveErrors, covered, drive, motion_covariance, value_at, values_at
from lhdmap.proprioception.reckoning import DeadReckoning, ReckoningLimits
from lhdmap.proprioception.samples import SampleBuffer, Warnings
from lhdmap.settings import setting

Source = Literal["articulated", "wheel_pose", "tachometer"]


@dataclass(frozen=True, slots=True)
class WheelSettings:
    """Wheel odometry: what is believed of tachometer, articulation and dead reckoning."""

    scale_std: float = setting(0.02, minimum=0.0, maximum=1.0, doc="Scale error of the tachometer, standard deviation.")
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
    pose_distance_std: float = setting(0.07, unit="m/m", minimum=0.0, doc="Dead reckoning: error of each metre driven.")
    pose_turn_std: float = setting(0.3, unit="rad/rad", minimum=0.0, doc="Dead reckoning: error of each radian turned.")
    pose_drift_deg: float = setting(
        6.0, unit="deg/m", minimum=0.0, doc="Dead reckoning: heading error for each metre driven."
    )
    pose_time_std_s: float = setting(
        0.05,
        unit="s",
        source="measured: robots' logs (docs/odometry.md)",
        minimum=0.0,
        doc="Dead reckoning: by how much the stamps of poses and scans may differ.",
    )
    max_gap_s: float = setting(0.5, unit="s", minimum=0.01, doc="Tachometer, joints: across a longer gap no motion.")
    max_hold_s: float = setting(0.2, unit="s", minimum=0.0, doc="The last samples stand for this long after them.")
    max_speed_mps: float = setting(15.0, unit="m/s", minimum=0.1, doc="A faster machine is an error of the sensor.")
    max_jump_m: float = setting(1.0, unit="m", minimum=0.0, doc="Dead reckoning may jump by this whatever the speed.")
    max_pose_gap_s: float = setting(
        1.5, unit="s", minimum=0.01, doc="Dead reckoning is interpolated between poses that are not farther apart."
    )
    keep_s: float = setting(60.0, unit="s", minimum=1.0, doc="Samples are kept for this long.")


_STRAIGHT = np.zeros(1, dtype=np.int64), np.zeros(1)  # an articulation of zero at any time
RESOLUTION = 1e-3  # of poses in logs, m and rad


class WheelMotion(NamedTuple):
    """Planar motion of `base_link`: `delta` (x, y, heading) in the frame at its start, `covariance` (3, 3); m, rad."""

    delta: FloatArray
    covariance: FloatArray
    source: Source


class WheelOdometry:
    """Takes tachometer, joints and wheel poses in the order of the log; gives the motion between any two times kept."""

    def __init__(self, settings: WheelSettings, machine: Machine) -> None:
        self.settings = settings
        self.warnings = Warnings()
        size = machine.dimensions
        self._lengths = (size.joint_to_front_axle_m, size.joint_to_rear_axle_m)
        self._max_articulation_rad = math.radians(size.max_articulation_deg) + 0.2
        keep_s = settings.keep_s
        self._speeds = SampleBuffer("tachometer", 1, keep_s, self.warnings)
        self._angles = SampleBuffer("articulation", 1, keep_s, self.warnings)
        self._limits_ns = round(settings.max_gap_s * 1e9), round(settings.max_hold_s * 1e9)  # gap, hold
        self._bending, self._straight = self._drive_errors()
        self._pose_gap_ns = round(settings.max_pose_gap_s * 1e9)
        limits = ReckoningLimits(settings.max_speed_mps, settings.max_jump_m, self._pose_gap_ns, self._limits_ns[1])
        self._poses = DeadReckoning(limits, keep_s, self.warnings)

    def update(self, message: Tachometer | Joints | WheelPose) -> None:
        """Take one message; values that cannot be are left out, with a warning."""
        if isinstance(message, Tachometer):
            self._take_speed(message)
        elif isinstance(message, Joints):
            self._take_joints(message)
        else:
            self._poses.update(message)

    def ready_until_ns(self, now_ns: int, judged_ns: int | None = None) -> int:
        """Return the latest time up to which later messages will not change a motion any more.

        `now_ns` is the newest stamp of the log. A sensor that has been silent for `max_gap_s` (poses: `max_pose_gap_s`) before
        `judged_ns` is not waited for: the newest stamp, or an older one where the whole log paused.
        """
        judged_ns = now_ns if judged_ns is None else judged_ns
        gap_ns, _ = self._limits_ns
        limits = ((self._speeds, gap_ns), (self._angles, gap_ns), (self._poses.samples, self._pose_gap_ns))
        newest = ((samples.latest_ns, limit_ns) for samples, limit_ns in limits)
        return min((ns for ns, limit_ns in newest if ns is not None and judged_ns - ns <= limit_ns), default=now_ns)

    @property
    def heard_until_ns(self) -> int | None:
        """Time of the newest sample, of the slower of the sensors that tell the motion; None where there are none."""
        driven = [samples.latest_ns for samples in (self._speeds, self._angles) if samples.latest_ns is not None]
        return min(driven) if driven else self._poses.samples.latest_ns

    def speed_at(self, stamp_ns: int) -> float | None:
        """Return the tachometer's speed as it was measured (m/s, not calibrated), or None where there is none."""
        return self._value(self._speeds, stamp_ns)

    def articulation_at(self, stamp_ns: int) -> float | None:
        """Return the articulation angle (rad), or None where there is none."""
        return self._value(self._angles, stamp_ns)

    def articulations_at(self, stamps_ns: npt.NDArray[np.int64]) -> FloatArray:
        """Return the articulation angles (rad) at many times, shape (N,); NaN where there is none."""
        angles = self._angles
        return values_at(angles.stamps_ns, angles.rows[:, 0], stamps_ns, self._limits_ns)

    def motion_between(self, start_ns: int, end_ns: int) -> WheelMotion | None:
        """Return the motion between two times, or None where no sensor covers them.

        Where `end_ns` is earlier there is none either, but for dead reckoning with poses of just these stamps.
        """
        speeds = end_ns >= start_ns and self._covers(self._speeds, start_ns, end_ns)
        if speeds and self._covers(self._angles, start_ns, end_ns):
            return self._driven(start_ns, end_ns, "articulated")
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

    def _drive_errors(self) -> tuple[DriveErrors, DriveErrors]:
        """Return what is believed of motion with known, and with unknown, articulation."""
        s, (L_f, L_r) = self.settings, self._lengths
        noise_rad = math.sqrt(2.0) * math.radians(s.articulation_noise_deg) * L_r / (L_f + L_r)
        known = DriveErrors(
            math.radians(s.articulation_std_deg), noise_rad, s.scale_std, s.speed_std_mps, s.side_slip_std
        )
        return known, known._replace(articulation_rad=math.radians(s.unknown_articulation_deg))

    def _value(self, samples: SampleBuffer, stamp_ns: int) -> float | None:
        value = value_at(samples.stamps_ns, samples.rows[:, 0], stamp_ns, self._limits_ns)
        return None if math.isnan(value) else float(value)

    def _covers(self, samples: SampleBuffer, start_ns: int, end_ns: int) -> bool:
        """Return whether samples go from start to end without a long gap (the last one may be held for a while)."""
        return bool(covered(samples.stamps_ns, (start_ns, end_ns), *self._limits_ns))

    def _driven(self, start_ns: int, end_ns: int, source: Source) -> WheelMotion:
        speeds, angles = self._speeds, self._angles
        if source == "articulated":
            articulation, errors = (angles.stamps_ns, angles.rows[:, 0]), self._bending
        else:
            articulation, errors = _STRAIGHT, self._straight
        speed = speeds.stamps_ns, speeds.rows[:, 0]
        return WheelMotion(*drive(speed, articulation, (start_ns, end_ns), self._lengths, 1.0, errors), source)

    def _reckoned(self, start_ns: int, end_ns: int) -> WheelMotion | None:
        settings, step = self.settings, self._poses.step_between(start_ns, end_ns)
        if step is None:
            return None
        delta, late_s = step.delta, settings.pose_time_std_s
        path_m = math.hypot(delta[0], delta[1])
        turn = math.hypot(settings.pose_turn_std * delta[2], math.radians(settings.pose_drift_deg) * path_m)
        turn = math.hypot(turn, late_s * step.turn_rps, RESOLUTION)
        along = math.hypot(settings.pose_distance_std * path_m, late_s * step.speed_mps, RESOLUTION)
        return WheelMotion(delta, motion_covariance(along, along, turn, delta), "wheel_pose")
