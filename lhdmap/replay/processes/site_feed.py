"""How a machine on a surface site moves: pose of its receiver, joint encoder, tachometer, read at the same time."""

from __future__ import annotations

import math

from lhdmap.driving.motion import Motion
from lhdmap.replay.process import SITE_POSE, Received
from lhdmap.roles import ROLES

JOINTS, TACHOMETER = ROLES["joints"].topic, ROLES["tachometer"].topic
SITE_TOPICS = (SITE_POSE, JOINTS, TACHOMETER)
_APART_NS = 30_000_000


class SiteFeed:
    """Takes messages; `motion` is the newest, of a pose with joint and speed of its time. What is missing, late or nan is none."""

    def __init__(self) -> None:
        self.motion: Motion | None = None
        self._joint = (0, math.nan, math.nan)
        self._speed = (0, math.nan)

    def take(self, received: Received) -> bool:
        """Take a message of one of `SITE_TOPICS`; return whether there is a new motion."""
        topic, _, message = received
        if topic == JOINTS:
            angle, rate = (one.get("articulation", math.nan) for one in (message.positions_rad, message.velocities_rps))
            self._joint = message.stamp_ns, angle, rate
        elif topic == TACHOMETER:
            self._speed = message.stamp_ns, message.speed_mps
        elif topic == SITE_POSE:
            at_ns = message.stamp_ns
            if max(at_ns - self._joint[0], at_ns - self._speed[0]) <= _APART_NS:
                place = message.x_m, message.y_m, message.heading_rad
                motion = Motion(at_ns, *place, self._joint[1], self._joint[2], self._speed[1])
                if all(map(math.isfinite, motion)):
                    self.motion = motion
                    return True
        return False
