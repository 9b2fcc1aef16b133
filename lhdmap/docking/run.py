"""A way of legs, driven one after the other: the next begins where the machine stands at the end of the last."""

from __future__ import annotations

from collections.abc import Sequence

from lhdmap.driving.motion import Motion, Setpoint
from lhdmap.tracking.reference import Curve
from lhdmap.tracking.tracker import Step, Tracker


class LegRun:
    """Steps a tracker along legs, as `plan_dock` gives them; `left` legs are not done yet."""

    def __init__(self, tracker: Tracker, legs: Sequence[Curve], speed_mps: float) -> None:
        self._tracker, self._legs, self._speed = tracker, list(legs), speed_mps
        self._next()

    @property
    def left(self) -> int:
        """Legs that are not done, the one that is driven included."""
        return len(self._legs) + 1

    def step(self, now_ns: int, motion: Motion | None, sent: Sequence[Setpoint] | None = None) -> Step:
        """Return what to do, as `Tracker.step`; "arrived" at the end of the last leg alone."""
        step = self._tracker.step(now_ns, motion, sent)
        if step.state == "arrived" and self._legs:
            self._next()
            step = step._replace(state="tracking")  # it stands for one period, and goes on in the other gear
        return step

    def _next(self) -> None:
        if self._legs:
            self._tracker.follow_curve(self._legs.pop(0), self._speed)
