"""The health of the slow sensors: inclinometer, joints, tachometer, pressures, wheel odometry."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.messages import GroundTruth, Inclination, Joints, Message, PointCloud, Pressure, Tachometer, WheelPose

_MANY = 50
_FEW = 20
_MAX_TILT_RAD = math.radians(40.0)
_GRAVITY_MPS2, _GRAVITY_TOLERANCE_MPS2 = 9.81, 0.5
_MAX_JUMP_M = 5.0


class ValueWatch:
    """Gathers least and greatest values of one topic and how often its content was the same as before.

    `path_m`: length of the path of a topic of poses.
    """

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.frame_id = ""
        self._kind: type[Message] | None = None
        self._count = self._repeated = 0
        self._last: tuple[float, ...] = ()
        self._low = self._high = np.empty(0)
        self._gravity_sum = 0.0
        self._gravity_count = 0
        self._jump_m = 0.0
        self.path_m = 0.0

    def update(self, message: Message) -> None:
        """Take in one message."""
        if isinstance(message, (Inclination, PointCloud)):
            self.frame_id = message.frame_id
        values = _values(message)
        if not values:
            return
        if isinstance(message, Inclination) and message.acceleration_mps2 is not None:
            self._gravity_sum += math.hypot(*message.acceleration_mps2.tolist())
            self._gravity_count += 1
        if isinstance(message, (WheelPose, GroundTruth)) and self._count:
            step_m = math.hypot(values[0] - self._last[0], values[1] - self._last[1])
            self._jump_m = max(self._jump_m, step_m)
            self.path_m += step_m
        self._repeated += values == self._last
        self._kind, self._last = type(message), values
        self._extend(np.array(values))
        self._count += 1

    @property
    def never_changes(self) -> bool:
        """Whether all of many messages said the same, to the last digit."""
        return self._count >= _FEW and self._repeated == self._count - 1

    @property
    def is_zero(self) -> bool:
        """Whether the last message said zero."""
        return not any(self._last)

    @property
    def last_text(self) -> str:
        """What the last message said."""
        return ", ".join(f"{value:.4g}" for value in self._last)

    def findings(self) -> list[LogFinding]:
        """Return what is to be said."""
        found = []
        if self._count >= _MANY and self.never_changes:
            text = f"its value never changes ({self.last_text})"
            found.append(LogFinding(Severity.REMARK, self.topic, text, "is the sensor connected?"))
        if self._kind is Inclination:
            found += self._tilt()
        if self._kind is WheelPose and self._jump_m > _MAX_JUMP_M:
            text = f"the pose jumps by up to {self._jump_m:.1f} m"
            found.append(
                LogFinding(Severity.PROBLEM, self.topic, text, "the odometry was reset or is corrected: not motion")
            )
        return found

    def _extend(self, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
        if self._low.shape != values.shape:
            self._low = self._high = values
        self._low, self._high = np.fmin(self._low, values), np.fmax(self._high, values)

    def _tilt(self) -> list[LogFinding]:
        found = []
        worst = float(np.max(np.abs([self._low, self._high])))
        if worst > _MAX_TILT_RAD:
            text = f"roll or pitch reaches {math.degrees(worst):.0f} deg"
            advice = "check its mount: roll and pitch of the front body are wanted (REP 103)"
            found.append(LogFinding(Severity.PROBLEM, self.topic, text, advice))
        if self._gravity_count:
            gravity = self._gravity_sum / self._gravity_count
            if abs(gravity - _GRAVITY_MPS2) > _GRAVITY_TOLERANCE_MPS2:
                text = f"the mean acceleration is {gravity:.2f} m/s2, not gravity's {_GRAVITY_MPS2}"
                found.append(
                    LogFinding(Severity.REMARK, self.topic, text, "unit or offset of the accelerometer is wrong")
                )
        return found


def _values(message: Message) -> tuple[float, ...]:
    if isinstance(message, Inclination):
        return message.roll_rad, message.pitch_rad
    if isinstance(message, Tachometer):
        return (message.speed_mps,)
    if isinstance(message, Pressure):
        return (message.pressure_pa,)
    if isinstance(message, WheelPose):
        return message.x_m, message.y_m, message.heading_rad
    if isinstance(message, GroundTruth):
        return tuple(message.position_m.tolist())
    return tuple(message.positions_rad.values()) if isinstance(message, Joints) else ()
