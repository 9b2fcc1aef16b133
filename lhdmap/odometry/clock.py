"""The time between scans for the motion model: the stamps', unless those bunch or run backwards."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_SHARE_OF_PERIOD = 0.3  # a scan sooner than this part of the period came in a bunch
_BUNCHED_SHARE = 0.08  # share of such scans beyond which the stamps are those of delivery, not of measurement
_FORGET = 0.01  # what one scan counts for in the period and in the share: a memory of a hundred scans
_PULL = 0.1  # of what the steady clock is off that each scan takes back: a delay of one message moves it by a tenth
_LONGEST_PERIODS = (
    18.0  # beyond it a log has a gap, which is no period, and the steady clock follows the stamps at once
)
_LEARN_SCANS = 30  # until then any time between scans teaches the period, and stamps are believed
_STEADY_PERIODS = (0.5, 3.0)  # limits of one step of the steady clock, so that it never stands still nor leaps
_FEWEST, _UNEVEN, _TAILS = (
    8,
    5.0,
    (0.1, 0.9),
)  # of the first steps the long ones are so many times the short ones in a bunch
_LEAST_S = 1e-6  # stamps nearer than this (made rising by a nanosecond) tell no time: a period has passed


class ScanClock:
    """Gives the time since the scan before.

    Stamps are taken as they are while they are regular. Where many scans come at once, or stamps run backwards, they tell
    when a message was delivered: the period is then steady and a slow loop keeps it in step with the stamps.
    """

    def __init__(self) -> None:
        self._first_ns: int | None = None
        self._last_s = 0.0  # after the first stamp: a float keeps nanoseconds of minutes, not of years
        self._smooth_s = 0.0
        self._period_s = 0.0
        self._bunched = 0.0
        self._scans = 0

    @property
    def bunched(self) -> bool:
        """Whether the stamps are not believed."""
        return self._scans > _LEARN_SCANS and self._bunched > _BUNCHED_SHARE

    def expect(self, stamps_ns: Sequence[int]) -> None:
        """Look at the stamps of the first scans before they are stepped through: in a bunch the speed of a turn runs away."""
        steps_s = 1e-9 * np.diff(np.asarray(stamps_ns, dtype=np.int64))
        if len(steps_s) < _FEWEST:
            return
        short_s, long_s = np.quantile(steps_s, _TAILS)
        if long_s > _UNEVEN * max(short_s, 0.0):
            usual = steps_s[np.abs(steps_s) < _LONGEST_PERIODS * long_s]
            self._period_s, self._bunched, self._scans = max(float(usual.mean()), 0.0), 1.0, _LEARN_SCANS

    def step(self, stamp_ns: int) -> float:
        """Return the time (s) since the scan before; 0 for the first."""
        if self._first_ns is None:
            self._first_ns = stamp_ns
            return 0.0
        now_s = (stamp_ns - self._first_ns) * 1e-9
        dt_s = now_s - self._last_s
        self._last_s = now_s
        self._learn(dt_s)
        if not self.bunched:
            self._smooth_s = now_s
            return dt_s if dt_s > _LEAST_S else max(self._period_s, 0.0)
        return self._steady(now_s)

    def _learn(self, dt_s: float) -> None:
        self._scans += 1
        forget = max(_FORGET, 1.0 / self._scans)
        if abs(dt_s) < _LONGEST_PERIODS * self._period_s or self._scans < _LEARN_SCANS:
            self._period_s += forget * (dt_s - self._period_s)
        early = dt_s < _SHARE_OF_PERIOD * self._period_s
        self._bunched += forget * (float(early) - self._bunched)

    def _steady(self, now_s: float) -> float:
        ahead_s = now_s - self._smooth_s - self._period_s
        if abs(ahead_s) > _LONGEST_PERIODS * self._period_s:
            step_s = max(now_s - self._smooth_s, self._period_s)
        else:
            step_s = min(
                max(self._period_s + _PULL * ahead_s, _STEADY_PERIODS[0] * self._period_s),
                _STEADY_PERIODS[1] * self._period_s,
            )
        step_s = max(step_s, 0.0)
        self._smooth_s += step_s
        return step_s
