"""How late poses are: from the stamp of a scan until the pose of that moment is known, and until the scan itself is matched."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from lhdmap.live.latency import Latency

_SAME_CLOCK_NS = 60_000_000_000  # stamps that are farther from now are of another clock, or of an old log
_SETTLED = 5  # messages that may wait once those of the start have been worked off


class Lateness:
    """`pose`: of the pose at a scan's stamp, carried on by the sensors; `scan`: of the pose of the newest scan that is matched.

    Counted once the messages of the start were worked off, after `caught_up_s`.
    """

    def __init__(self, now_ns: Callable[[], int] = time.time_ns) -> None:
        self.pose, self.scan = Latency(), Latency()
        self.caught_up_s: float | None = None
        self._now_ns, self._began_s = now_ns, time.monotonic()
        self._matched_ns: int | None = None

    def take(self, stamp_ns: int, matched_ns: int | None, waiting: int) -> None:
        """Take the stamp of a scan whose pose is known now, the time of the newest pose that is matched, and what waits."""
        now_ns = self._now_ns()
        if abs(now_ns - stamp_ns) > _SAME_CLOCK_NS:
            return
        if self.caught_up_s is None:
            if waiting > _SETTLED:
                return
            self.caught_up_s = time.monotonic() - self._began_s
        self.pose.add((now_ns - stamp_ns) * 1e-6)
        if matched_ns is not None and matched_ns != self._matched_ns:
            self._matched_ns = matched_ns
            self.scan.add((now_ns - matched_ns) * 1e-6)

    def to_json(self) -> dict[str, Any]:
        """Return the figures."""
        return {"pose": self.pose.to_json(), "scan": self.scan.to_json()}
