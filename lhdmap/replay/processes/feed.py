"""How the machine moves, put together from what comes over the bus: pose of perception, joint encoder, tachometer."""

from __future__ import annotations

import math
from collections import deque

from lhdmap.driving.motion import Motion
from lhdmap.replay.process import POSE, Received
from lhdmap.roles import ROLES

JOINTS, TACHOMETER = ROLES["joints"].topic, ROLES["tachometer"].topic
MOTION_TOPICS = (POSE, JOINTS, TACHOMETER)
_RATE_LAG_S = 0.1
_SAMPLES, _LONG = 4, 12  # of the tachometer: its noise alone looks like creeping
_STANDS_MPS = 0.02


class MotionFeed:
    """Takes messages; `motion` is the newest, None before pose and joint have been heard. Gaps stay gaps: nothing is made up.

    `heard_ns`: up to when both joint and tachometer have been heard.
    """

    def __init__(self) -> None:
        self.motion: Motion | None = None
        self.heard_ns: int | None = None
        self._joint: tuple[int, float, float] | None = None
        self._speed_ns: int | None = None
        self._speeds: deque[float] = deque(maxlen=_LONG)

    def take(self, received: Received) -> None:
        """Take a message of one of `MOTION_TOPICS`."""
        topic, _, message = received
        if topic == JOINTS:
            bend, rate = (
                table.get("articulation", math.nan) for table in (message.positions_rad, message.velocities_rps)
            )
            self._bend(message.stamp_ns, bend, rate)
        elif topic == TACHOMETER:
            if math.isfinite(message.speed_mps):
                self._speeds.append(message.speed_mps)
                self._speed_ns = message.stamp_ns
                self._hear()
        elif topic == POSE and self._joint is not None:
            T = message.T_odom_base
            heading = math.atan2(T[1, 0], T[0, 0])
            _, bend, rate = self._joint
            speed = self._speed()
            self.motion = Motion(message.stamp_ns, float(T[0, 3]), float(T[1, 3]), heading, bend, rate, speed)

    def _speed(self) -> float:
        """Return the speed of now: of the last samples; none where they are the noise of a machine that stands."""
        speeds = list(self._speeds)
        if not speeds or abs(sum(speeds) / len(speeds)) < _STANDS_MPS:
            return 0.0
        newest = speeds[-_SAMPLES:]
        return sum(newest) / len(newest)

    def _bend(self, stamp_ns: int, bend: float, rate: float) -> None:
        if not math.isfinite(bend):
            return
        before = self._joint
        if not math.isfinite(rate):
            step_s = 0.0 if before is None else (stamp_ns - before[0]) * 1e-9
            raw = 0.0 if before is None or step_s <= 0.0 else (bend - before[1]) / step_s
            rate = 0.0 if before is None else before[2] + (raw - before[2]) * -math.expm1(-step_s / _RATE_LAG_S)
        self._joint = stamp_ns, bend, rate
        self._hear()

    def _hear(self) -> None:
        if self._joint is not None and self._speed_ns is not None:
            self.heard_ns = min(self._joint[0], self._speed_ns)
