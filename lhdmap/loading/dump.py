"""Dumping: the boom up, the bucket down until nothing falls any more, and both back into tramming posture.

A joint that does not move any more is at its stop, but only where that is far enough: an angle may also be an old one. Where it is
not far enough for long, the dump ends `stuck`, and nobody counts the bucket as empty.
"""

from __future__ import annotations

from lhdmap.loading.signals import Pedals, Signals, Turn

RAISE, TIP, WAIT, RACK, LOWER = "raise", "tip", "wait", "rack", "lower"
_RAISED_RAD, _TIPPED_RAD, _RACKED_RAD, _LOWERED_RAD = 0.45, -0.78, -0.03, 0.03
_FALLS_NS = 2_000_000_000
_STILL_NS = 700_000_000  # a joint that does not move for so long is at its stop
_STILL_RAD = 0.004
_TIPPED_ENOUGH_RAD, _RACKED_ENOUGH_RAD, _LOWERED_ENOUGH_RAD = -0.45, -0.2, 0.15
_STUCK_NS = 15_000_000_000  # each joint goes all its way in 7 s


class Dump:
    """A controller: begun where the machine stands before the dump; ends `dumped`, or `stuck`.

    Its time is that of the signals: whoever lets it rest stops their clock, too, or a joint that rested counts as one at its stop.
    """

    def __init__(self) -> None:
        self.phase = RAISE
        self._since_ns = 0
        self._moved: tuple[int, float] = (0, 0.0)

    def begin(self, signals: Signals) -> None:
        """Begin at this moment."""
        self._goes(RAISE, signals)

    def step(self, signals: Signals) -> Turn:
        """Return what is to be done now."""
        if self.phase == RAISE:
            return self._until(
                signals, signals.boom_rad > _RAISED_RAD, Pedals(lift=1.0, full_rpm=True, brake=True), TIP
            )
        if self._sticks(signals):
            return Turn(Pedals(brake=True), "stuck")
        if self.phase == TIP:
            return self._until(
                signals, signals.bucket_rad < _TIPPED_RAD, Pedals(tilt=-1.0, full_rpm=True, brake=True), WAIT
            )
        if self.phase == WAIT:
            over = signals.now_ns - self._since_ns >= _FALLS_NS
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

    def _far_enough(self, signals: Signals) -> bool:
        """Return whether a stop here may be the joint's own."""
        if self.phase == TIP:
            return signals.bucket_rad < _TIPPED_ENOUGH_RAD
        if self.phase == RACK:
            return signals.bucket_rad > _RACKED_ENOUGH_RAD
        return self.phase != LOWER or signals.boom_rad < _LOWERED_ENOUGH_RAD

    def _sticks(self, signals: Signals) -> bool:
        """Return whether a joint has been at it for long, and is not far enough."""
        return signals.now_ns - self._since_ns > _STUCK_NS and not self._far_enough(signals)

    def _goes(self, phase: str, signals: Signals) -> None:
        self.phase, self._since_ns = phase, signals.now_ns
        self._moved = signals.now_ns, float("inf")
