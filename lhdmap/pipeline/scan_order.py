"""Times of scans and wheel poses that never run backwards, and the scans that wait for the slower sensors."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from lhdmap.messages import LaserScan, PointCloud
from lhdmap.scan_matching.scan_points import half_sweep_ns

LONG_AGO_NS = -(2**62)
_PATIENCE_SCANS = 3  # after a pause of the whole log, wheels may come within as many scans before they count as silent
_MOMENT_NS = 5_000_000  # a scan without a hit so soon after another is none of its own
_RUNS_ON_NS = 200_000_000  # a clock that others tell at most so long before the newest scan was not set back
_WARM_SCANS, _FEWEST_WARM_SCANS, _WARM_NS = 50, 6, 1_500_000_000
_QUEUE_SCANS = 2000  # a sensor that stops must not hold back scans without bound


class TimedScan(NamedTuple):
    """A scan of the primary scanner with its stamp made rising."""

    scan: LaserScan | PointCloud
    stamp_ns: int

    @property
    def time_ns(self) -> int:
        """The middle of its sweep: the time for which attitude and wheels are needed."""
        return self.stamp_ns + (half_sweep_ns(self.scan) if isinstance(self.scan, LaserScan) else 0)


class ScanOrder:
    """Makes stamps rise once those of scans did not: the order of the log then tells more. `newest_ns`: the newest scan's."""

    def __init__(self) -> None:
        self.newest_ns = self._clock_ns = LONG_AGO_NS
        self._last = (LONG_AGO_NS, LONG_AGO_NS)  # of the newest scan: its stamp, and that made rising
        self._disordered = False

    def of_scan(self, scan: LaserScan | PointCloud) -> TimedScan:
        """Return a scan, the next of the log, with its time."""
        self._disordered |= scan.stamp_ns < self.newest_ns
        self.newest_ns = max(self.newest_ns, scan.stamp_ns)
        self._last = scan.stamp_ns, self._rising(scan.stamp_ns)
        return TimedScan(scan, self._last[1])

    def of_wheels(self, stamp_ns: int) -> int:
        """Return the stamp of a wheel pose, made rising; one that came with a scan stays with it."""
        return self._last[1] if stamp_ns == self._last[0] else self._rising(stamp_ns)

    def _rising(self, stamp_ns: int) -> int:
        if self._disordered:
            stamp_ns = max(stamp_ns, self._clock_ns + 1)
        self._clock_ns = max(self._clock_ns, stamp_ns)
        return stamp_ns


class OverdueScans:
    """Tells scans that come behind newer ones while the other sensors' clock runs on: a slow link holds them up.

    Where nothing else has a clock, or it was set back with the scans', the order of the log tells more (`ScanOrder`).
    """

    def __init__(self) -> None:
        self.count = 0
        self._heard_ns = LONG_AGO_NS

    def hear(self, stamp_ns: int) -> None:
        """Take the stamp of a message of inclinometer, tachometer or joints."""
        self._heard_ns = stamp_ns

    def is_late(self, scan: LaserScan | PointCloud, newest_ns: int) -> bool:
        """Return whether a scan is late, the newest one before being of `newest_ns`; it is counted then."""
        late = scan.stamp_ns < newest_ns <= self._heard_ns + _RUNS_ON_NS
        self.count += late
        return late

    def warnings(self) -> list[str]:
        """Return what to say of them."""
        return [f"{self.count} scans of the front scanner came behind newer ones; left out"] if self.count else []


class ScanQueue:
    """Scans that wait until attitude and wheels beyond them are known."""

    def __init__(self) -> None:
        self._waiting: deque[TimedScan] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def append(self, scan: TimedScan) -> None:
        """Take the newest scan."""
        self._waiting.append(scan)

    def pop(self) -> TimedScan:
        """Take out the oldest scan."""
        return self._waiting.popleft()

    def is_ready(self, until_ns: int) -> bool:
        """Return whether the oldest scan need not wait any longer."""
        return bool(self._waiting) and (self._waiting[0].time_ns <= until_ns or len(self) > _QUEUE_SCANS)

    def is_warm(self, until_ns: int) -> bool:
        """Return whether enough scans wait for the dry run that finds the starting speed."""
        waiting = self._waiting
        enough = len(waiting) >= _WARM_SCANS or (
            len(waiting) >= _FEWEST_WARM_SCANS and waiting[-1].stamp_ns - waiting[0].stamp_ns >= _WARM_NS
        )
        return enough and waiting[min(_WARM_SCANS, len(waiting)) - 1].time_ns <= until_ns

    def first(self) -> list[TimedScan]:
        """Return the scans of the dry run that wait behind the one just taken out."""
        return list(self._waiting)[: _WARM_SCANS - 1]


class WaitingScans:
    """The scans of the primary scanner on their way to the odometry: in `order`, in the `queue`, and up to when they are used.

    `overdue`: those that came too late; `used_ns`: time of the newest scan that the odometry has; `said_ns`: stamp of the newest
    one that said anything.
    """

    def __init__(self) -> None:
        self.order, self.queue, self.overdue = ScanOrder(), ScanQueue(), OverdueScans()
        self.used_ns = self.said_ns = LONG_AGO_NS

    def is_late(self, scan: LaserScan | PointCloud) -> bool:
        """Return whether the next scan of the log came behind newer ones (`OverdueScans`)."""
        return self.overdue.is_late(scan, self.order.newest_ns)

    def append(self, scan: LaserScan | PointCloud) -> None:
        """Take the next scan of the log."""
        self.queue.append(self.order.of_scan(scan))

    def rising(self, time_ns: int) -> int:
        """Return a time, later than that of the newest scan used."""
        return max(time_ns, self.used_ns + 1)

    @property
    def judged_ns(self) -> int | None:
        """From when on silent wheels are judged; None while those of a pause may still come."""
        paused = len(self.queue) < _PATIENCE_SCANS and self.used_ns > 0
        return self.used_ns if paused else None


def says_nothing(scan: LaserScan, after_ns: int) -> bool:
    """Return whether a scan is none: without beams, or without a hit a moment after another one."""
    return not scan.ranges_m.size or (after_ns < _MOMENT_NS and not bool((scan.ranges_m < scan.range_max_m).any()))
