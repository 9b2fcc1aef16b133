"""Sweeps that cannot last as long as they say: drivers that fill in the time increment wrongly (a scan's time for a beam's).

Of clouds, readers of logs have taken out single times that cannot be (`lhdmap.logs.cloud_times`); here whole sweeps are judged,
wherever they come from.
"""

from __future__ import annotations

from collections import deque
from typing import overload

import numpy as np

from lhdmap.messages import LaserScan, PointCloud

_LONGEST_S = 1.0  # no scanner turns slower
_STEPS = 9
_LONGER = 1.2


class SweepTimes:
    """Takes the times out of sweeps that would last longer than the time between them."""

    def __init__(self) -> None:
        self._last_ns: dict[str, int] = {}
        self._steps_s: dict[str, deque[float]] = {}
        self._worst_s: dict[str, tuple[str, float]] = {}

    @overload
    def checked(self, role: str, sweep: LaserScan) -> LaserScan: ...
    @overload
    def checked(self, role: str, sweep: PointCloud) -> PointCloud: ...
    @overload
    def checked(self, role: str, sweep: LaserScan | PointCloud) -> LaserScan | PointCloud: ...
    def checked(self, role: str, sweep: LaserScan | PointCloud) -> LaserScan | PointCloud:
        """Return a scanner's sweep as it can be taken."""
        steps_s = self._steps_s.setdefault(role, deque(maxlen=_STEPS))
        if role in self._last_ns:
            steps_s.append((sweep.stamp_ns - self._last_ns[role]) * 1e-9)
        self._last_ns[role] = sweep.stamp_ns
        period_s = max(steps_s) if len(steps_s) == _STEPS else _LONGEST_S
        lasts_s = _lasts_s(sweep)
        if lasts_s <= _LONGER * period_s:
            return sweep
        said, worst_s = self._worst_s.get(role, ("", 0.0))
        if isinstance(sweep, LaserScan):
            said, sweep = "its time increment", sweep._replace(time_increment_s=0.0)
        else:
            said, sweep = "the times of its points", sweep._replace(time_offsets_s=np.empty(0, np.float32))
        self._worst_s[role] = said, max(worst_s, lasts_s)
        return sweep

    @property
    def warnings(self) -> list[str]:
        """What was taken out, in words."""
        return [
            f"{role} scanner: by {said} a sweep lasts {worst_s:.3g} s, longer than the time to the next; not used"
            for role, (said, worst_s) in self._worst_s.items()
        ]


def _lasts_s(sweep: LaserScan | PointCloud) -> float:
    if isinstance(sweep, LaserScan):
        return abs(sweep.time_increment_s) * max(sweep.ranges_m.size - 1, 0)
    return float(np.ptp(sweep.time_offsets_s)) if len(sweep.time_offsets_s) else 0.0
