"""Dumping: the boom up, the bucket down until nothing falls any more, and both back into tramming posture.

A bucket is tipped when its floor is steep enough for ore to slide out, and empty when the lift cylinder says so: an angle alone
may be an old or a wrong one. A joint that does not move any more is at its stop, but only where that is far enough. Where a joint
is not far enough for long, or the bucket not empty, the dump ends `stuck` or `not empty`, and nobody counts the bucket as dumped.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.weighing_settings import WeighingSettings
from lhdmap.machine_sections import Linkage

RAISE, TIP, WAIT, RACK, LOWER = "raise", "tip", "wait", "rack", "lower"
_RAISED_RAD, _RACKED_RAD, _LOWERED_RAD = 0.45, -0.03, 0.03
_TIPPED_RAD, _TIPPED_ENOUGH_RAD = (
    -0.75,
    -0.68,
)  # of the bucket's floor, lip down: broken rock slides from some 38 degrees on
_RACKED_ENOUGH_RAD, _LOWERED_ENOUGH_RAD = -0.2, 0.15
_FALLS_NS = 2_000_000_000
_STILL_NS = 700_000_000  # a joint that does not move for so long is at its stop
_STILL_RAD = 0.004
_STUCK_NS = 22_000_000_000  # each joint goes all its way in 15 s at 0.155 rad/s
_EMPTY_FILL = 0.25  # by Eq. (9): a heap that sticks is more, the lever arm of a tipped bucket less
_HEARD = 25  # pressures of half a second: it swings while ore falls


class Dump:
    """A controller: begun where the machine stands before the dump; ends `dumped`, `stuck` or `not empty`.

    Its time is that of the signals: whoever lets it rest stops their clock, too, or a joint that rested counts as one at its stop.
    Without a lift pressure the angle alone counts.
    """

    def __init__(self, linkage: Linkage | None = None, weighing: WeighingSettings | None = None) -> None:
        self.phase = RAISE
        self._linkage, self._weighing = linkage or Linkage(), weighing or WeighingSettings()
        self._since_ns = 0
        self._moved: tuple[int, float] = (0, 0.0)
        self._lift_bar: deque[float] = deque(maxlen=_HEARD)

    def begin(self, signals: Signals) -> None:
        """Begin at this moment."""
        self._goes(RAISE, signals)

    def step(self, signals: Signals) -> Turn:
        """Return what is to be done now."""
        self._lift_bar.append(signals.lift_bar)
        if self._sticks(signals):
            return Turn(Pedals(brake=True), "not empty" if self.phase == WAIT else "stuck")
        if self.phase == RAISE:
            return self._until(
                signals, signals.boom_rad > _RAISED_RAD, Pedals(lift=1.0, full_rpm=True, brake=True), TIP
            )
        if self.phase == TIP:
            tipped = self._floor_rad(signals) < _TIPPED_RAD
            return self._until(signals, tipped, Pedals(tilt=-1.0, full_rpm=True, brake=True), WAIT)
        if self.phase == WAIT:
            over = signals.now_ns - self._since_ns >= _FALLS_NS and self._empty()
            return self._until(signals, over, Pedals(brake=True), RACK)
        if self.phase == RACK:
            return self._until(
                signals, signals.bucket_rad > _RACKED_RAD, Pedals(tilt=1.0, full_rpm=True, brake=True), LOWER
            )
        still = self._still(signals, signals.boom_rad) and self._far_enough(signals)
        lowered = signals.boom_rad < _LOWERED_RAD or still
        return Turn(Pedals(lift=0.0 if lowered else -1.0, full_rpm=True, brake=True), "dumped" if lowered else "")

    def _until(self, signals: Signals, reached: bool, pedals: Pedals, following: str) -> Turn:
        moves = signals.boom_rad if self.phase == RAISE else signals.bucket_rad
        still = self.phase != WAIT and self._still(signals, moves)
        if reached or (still and self._far_enough(signals)):
            self._goes(following, signals)
            return Turn(Pedals(brake=True))
        return Turn(pedals)

    def _still(self, signals: Signals, angle_rad: float) -> bool:
        """Return whether a joint has not moved for a while."""
        if abs(angle_rad - self._moved[1]) > _STILL_RAD:
            self._moved = signals.now_ns, angle_rad
        return signals.now_ns - self._moved[0] > _STILL_NS

    def _floor_rad(self, signals: Signals) -> float:
        """Return the angle of the bucket's floor, lip up."""
        one = self._linkage
        lifted = one.boom_to_bucket * (signals.boom_rad - one.boom_min_rad)
        return one.bucket_angle_rad + signals.bucket_rad - one.bucket_max_rad + lifted

    def _empty(self) -> bool:
        """Return whether the lift cylinder carries no load any more, by Eq. (9) of the loading paper."""
        heard = [one for one in self._lift_bar if math.isfinite(one)]
        one = self._weighing
        return not heard or one.fill_per_bar * float(np.mean(heard)) - one.fill_offset < _EMPTY_FILL

    def _far_enough(self, signals: Signals) -> bool:
        """Return whether a stop here may be the joint's own."""
        if self.phase == TIP:
            return self._floor_rad(signals) < _TIPPED_ENOUGH_RAD
        if self.phase == RACK:
            return signals.bucket_rad > _RACKED_ENOUGH_RAD
        return self.phase != LOWER or signals.boom_rad < _LOWERED_ENOUGH_RAD

    def _sticks(self, signals: Signals) -> bool:
        """Return whether a phase has lasted for long, and what it is for is not reached."""
        reached = self._empty() if self.phase == WAIT else self._far_enough(signals)
        return signals.now_ns - self._since_ns > _STUCK_NS and not reached

    def _goes(self, phase: str, signals: Signals) -> None:
        self.phase, self._since_ns = phase, signals.now_ns
        self._moved = signals.now_ns, float("inf")
