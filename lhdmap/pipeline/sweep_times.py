"""Sweeps that cannot last as long as they say: drivers that fill in the time increment wrongly (a scan's time for a beam's)."""

from __future__ import annotations

from collections import deque

from lhdmap.messages import LaserScan

_LONGEST_S = 1.0  # no scanner turns slower
_STEPS = 9
_LONGER = 1.2


class SweepTimes:
    """Takes the time increment out of scans whose sweep would last longer than the time between scans."""

    def __init__(self) -> None:
        self._last_ns: dict[str, int] = {}
        self._steps_s: dict[str, deque[float]] = {}
        self._worst_s: dict[str, float] = {}

    def checked(self, role: str, scan: LaserScan) -> LaserScan:
        """Return a scanner's scan as it can be taken."""
        steps_s = self._steps_s.setdefault(role, deque(maxlen=_STEPS))
        if role in self._last_ns:
            steps_s.append((scan.stamp_ns - self._last_ns[role]) * 1e-9)
        self._last_ns[role] = scan.stamp_ns
        sweep_s = abs(scan.time_increment_s) * max(scan.ranges_m.size - 1, 0)
        period_s = max(steps_s) if len(steps_s) == _STEPS else _LONGEST_S
        if sweep_s <= _LONGER * period_s:
            return scan
        self._worst_s[role] = max(self._worst_s.get(role, 0.0), sweep_s)
        return scan._replace(time_increment_s=0.0)

    @property
    def warnings(self) -> list[str]:
        """What was taken out, in words."""
        return [
            f"{role} scanner: by its time increment a sweep lasts {worst_s:.3g} s, longer than the time to the next; not used"
            for role, worst_s in self._worst_s.items()
        ]
