"""A bucket that is buried deeper than it can break out stands still whatever is asked of it: it is backed out a little."""

from __future__ import annotations

from collections import deque

from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.signals import Signals


class BackOff:
    """Reverse pulse where nothing has moved for `stuck_s`: no tilt, no lift, no advance.

    Not "full tilt asked, and nothing moves": the force law may itself ask for little (loading findings, section 4).
    """

    def __init__(self, settings: ExcavationSettings) -> None:
        self._settings = settings
        self._rows: deque[tuple[int, float, float, float]] = deque()
        self._until_ns, self.pulses = 0, 0

    def update(self, signals: Signals) -> bool:
        """Return whether the machine is to be backed out now."""
        one, now_ns = self._settings, signals.now_ns
        if now_ns < self._until_ns:
            return True
        self._rows.append((now_ns, signals.bucket_rad, signals.boom_rad, signals.travel_m))
        while self._rows[0][0] < now_ns - one.stuck_s * 1e9:
            self._rows.popleft()
        if not one.back_off_s or not self._still(now_ns):
            return False
        self._rows.clear()
        self._until_ns = now_ns + round(one.back_off_s * 1e9)
        self.pulses += 1
        return True

    def _still(self, now_ns: int) -> bool:
        """Return whether all three have stood for the whole window; what is NaN has not."""
        one, first, last = self._settings, self._rows[0], self._rows[-1]
        span_s = (now_ns - first[0]) * 1e-9
        if span_s < 0.9 * one.stuck_s:
            return False
        most = (one.stuck_rps * span_s, one.stuck_rps * span_s, one.stuck_mps * span_s)
        return all(abs(last[k + 1] - first[k + 1]) <= most[k] for k in range(3))
