"""The loading task's signals, put together from what comes over the bus. Gaps stay gaps: nothing is made up."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lhdmap.driving.motion import Motion
from lhdmap.geometry import se2
from lhdmap.loading.signals import Signals
from lhdmap.messages import FloatArray
from lhdmap.replay.process import SEEN, Received
from lhdmap.replay.processes.feed import JOINTS, TACHOMETER
from lhdmap.replay.processes.told import Seen
from lhdmap.roles import ROLES

_PRESSURES = tuple(ROLES[name].topic for name in ("transmission_pressure", "lift_pressure", "tilt_pressure"))
SIGNAL_TOPICS = (JOINTS, TACHOMETER, SEEN, *_PRESSURES)
_BAR_PA = 1e5
_SCANS_NS = 200_000_000  # two scans alone: their noise of some millimetres is a speed of centimetres per second


class SignalFeed:
    """Takes messages of `SIGNAL_TOPICS`; `signals` puts the newest of each together, None before joints and tachometer."""

    def __init__(self) -> None:
        self.seen: Seen | None = None
        self._heard_ns: dict[str, int] = {}
        self._joints = (math.nan, math.nan, math.nan)
        self._tacho_mps = math.nan
        self._bars = [math.nan, math.nan, math.nan]
        self._poses: deque[tuple[int, FloatArray]] = deque()
        self._travel_m = 0.0

    def take(self, received: Received) -> None:
        """Take a message."""
        topic, _, message = received
        if topic == JOINTS:
            angles = message.positions_rad
            names = ("boom_lift", "bucket_tilt", "articulation")
            self._joints = tuple(angles.get(name, math.nan) for name in names)
            self._heard_ns[topic] = message.stamp_ns
        elif topic == TACHOMETER:
            self._tacho_mps, self._heard_ns[topic] = message.speed_mps, message.stamp_ns
        elif topic in _PRESSURES:
            self._bars[_PRESSURES.index(topic)] = message.pressure_pa / _BAR_PA
            self._heard_ns[topic] = message.stamp_ns
        elif topic == SEEN:
            self._see(message)

    def signals(self) -> Signals | None:
        """Return all that has been heard, with the oldest stamp of joints, tachometer and pressures."""
        if JOINTS not in self._heard_ns or TACHOMETER not in self._heard_ns:
            return None
        boom, bucket, bend = self._joints
        scan_ns, scan_mps = self._scan_speed()
        return Signals(
            min(self._heard_ns.values()), self._tacho_mps, scan_mps, scan_ns, self._travel_m, boom, bucket, bend, *self._bars
        )  # fmt: skip

    def walls_m(self, motion: Motion) -> FloatArray | None:
        """Return the hits (N, 2) of the newest scan in `base_link` of now."""
        seen = self.seen
        if seen is None:
            return None
        moved = se2.between(np.array([motion.x_m, motion.y_m, motion.heading_rad]), seen.pose_odom)
        return se2.transform(moved, seen.points_m)

    def _see(self, seen: Seen) -> None:
        if self.seen is not None:
            self._travel_m += float(se2.between(self.seen.pose_odom, seen.pose_odom)[0])
        self.seen = seen
        self._poses.append((seen.stamp_ns, seen.pose_odom))
        while len(self._poses) > 2 and seen.stamp_ns - self._poses[1][0] >= _SCANS_NS:
            self._poses.popleft()

    def _scan_speed(self) -> tuple[int, float]:
        """Return the stamp in the middle of the last scans, and the speed along x between them."""
        if len(self._poses) < 2:
            return (self._poses[-1][0] if self._poses else 0), math.nan
        (before_ns, before), (now_ns, now) = self._poses[0], self._poses[-1]
        return now_ns, float(se2.between(before, now)[0]) / ((now_ns - before_ns) * 1e-9)
