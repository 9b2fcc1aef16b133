"""The health of one 2D scanner: gathered scan by scan in constant memory, judged at the end."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.messages import Float32Array, LaserScan

_SAMPLES = 256  # scans kept for the statistics of single beams
_KINDS = 64  # different geometries that are counted
_FROZEN_RUN = 10  # identical scans in a row that no real scanner gives
_DEAD_SHARE, _WEAK_SHARE, _SATURATED_SHARE, _OWN_BODY_SHARE = 0.01, 0.1, 0.05, 0.9
_OWN_BODY_SPREAD_M, _MOVING_SPREAD_M = 0.03, 0.3
_MAX_RANGE_M = 500.0
_Geometry = tuple[int, float, float]


class _Beams:
    """Counts scans without a hit, and beams: all, those with a hit, and what is odd of the others."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._all = self._valid = self._nan = self._negative = self._top = self._scans = self._dead = 0

    def update(self, scan: LaserScan) -> None:
        ranges = scan.ranges_m
        hits = _valid(ranges, scan)
        valid = int(np.count_nonzero(hits))
        self._scans += 1
        self._all += len(ranges)
        self._valid += valid
        self._dead += valid == 0
        self._nan += int(np.count_nonzero(np.isnan(ranges)))
        self._negative += int(np.count_nonzero(ranges < 0))
        self._top += int(np.count_nonzero(hits & (ranges >= 0.995 * scan.range_max_m)))

    def findings(self) -> list[LogFinding]:
        share = self._valid / max(self._all, 1)
        found = []
        if _DEAD_SHARE <= share < _WEAK_SHARE:
            text = f"only {100 * share:.0f} % of the beams have a valid range"
            found.append(
                LogFinding(Severity.PROBLEM, self._topic, text, "check the scanner's window and its range limits")
            )
        if 0 < self._dead < self._scans:
            text = f"{self._dead} of {self._scans} scans have no valid beam"
            found.append(LogFinding(Severity.REMARK, self._topic, text, "motion is bridged by prediction there"))
        if self._top > _SATURATED_SHARE * self._valid > 0:
            text = f"saturated: {100 * self._top / self._valid:.0f} % of the valid ranges are at the greatest range"
            found.append(
                LogFinding(Severity.PROBLEM, self._topic, text, "the scanner seems to report no return as a range")
            )
        if self._nan:
            text = f"{100 * self._nan / self._all:.1f} % of the ranges are NaN (taken as no return)"
            found.append(LogFinding(Severity.NOTE, self._topic, text))
        if self._negative:
            found.append(
                LogFinding(Severity.REMARK, self._topic, f"{self._negative} negative ranges (taken as no return)")
            )
        return found


class _Repeats:
    """Counts scans that are those before again."""

    def __init__(self) -> None:
        self._last: Float32Array | None = None
        self._run = self._longest = self._identical = 0

    def update(self, scan: LaserScan) -> None:
        last, self._last = self._last, scan.ranges_m
        same = last is not None and last.tobytes() == scan.ranges_m.tobytes()
        self._identical += same
        self._run = self._run + 1 if same else 0
        self._longest = max(self._longest, self._run)

    def findings(self, topic: str) -> list[LogFinding]:
        if self._longest < _FROZEN_RUN:
            return []
        text = f"frozen: {self._longest + 1} identical scans in a row ({self._identical} repeated in all)"
        return [
            LogFinding(Severity.PROBLEM, topic, text, "check the driver; a simulated scanner without noise does this")
        ]


class ScanWatch:
    """Gathers what the scans of one topic show."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.frame_id = ""
        self._beams, self._repeats = _Beams(topic), _Repeats()
        self._first: LaserScan | None = None
        self._geometries: Counter[_Geometry] = Counter()
        self._samples: list[LaserScan] = []
        self._count, self._stride = 0, 1

    def update(self, scan: LaserScan) -> None:
        """Take in one scan."""
        if self._first is None:
            self._first, self.frame_id = scan, scan.frame_id
        self._beams.update(scan)
        self._repeats.update(scan)
        if len(self._geometries) < _KINDS:
            key = (len(scan.ranges_m), round(scan.angle_min_rad, 5), round(scan.angle_increment_rad, 7))
            self._geometries[key] += 1
        if self._count % self._stride == 0:
            self._samples.append(scan)
            if len(self._samples) >= _SAMPLES:
                self._samples, self._stride = self._samples[::2], 2 * self._stride
        self._count += 1

    def findings(self, period_s: float | None, stated_end_rad: float | None) -> list[LogFinding]:
        """Return what is to be said beside what the survey says.

        `period_s`: the usual time between scans; the stated angle of the last beam.
        """
        first = self._first
        if first is None:
            return []
        return [
            *self._beams.findings(),
            *self._repeats.findings(self.topic),
            *self._geometry(),
            *_stated_end(self.topic, first, stated_end_rad),
            *_unusual_limits(self.topic, first),
            *_timing(self.topic, first, period_s),
            *self._own_body(),
        ]

    def _geometry(self) -> list[LogFinding]:
        starts = sorted({start for _, start, _ in self._geometries})
        sizes = sorted({size for size, _, _ in self._geometries})
        if len(starts) > 1:
            listed = ", ".join(f"{math.degrees(start):.2f}" for start in starts[:6])
            text = f"interlaced: {len(starts)} start angles in turn ({listed} deg)"
            return [LogFinding(Severity.REMARK, self.topic, text, "the start angle of each scan is used")]
        if len(sizes) > 1:
            text = f"the number of beams changes ({', '.join(map(str, sizes[:6]))})"
            return [LogFinding(Severity.REMARK, self.topic, text)]
        return []

    def _own_body(self) -> list[LogFinding]:
        size = Counter(len(scan.ranges_m) for scan in self._samples).most_common(1)[0][0]
        table = np.array([scan.ranges_m for scan in self._samples if len(scan.ranges_m) == size])
        if len(table) < 20 or size == 0:
            return []
        scan = self._samples[0]
        valid = _valid(table, scan)
        often = valid.mean(axis=0) >= _OWN_BODY_SHARE
        low, high = np.quantile(np.where(valid, table, 0.0), (0.1, 0.9), axis=0)
        spread = high - low
        if not often.any() or float(np.median(spread[often])) < _MOVING_SPREAD_M:
            return []  # the machine stands: every beam is constant
        constant = np.flatnonzero(often & (spread < _OWN_BODY_SPREAD_M))
        if not len(constant):
            return []
        angles = scan.angle_min_rad + constant * scan.angle_increment_rad
        sector = f"{math.degrees(angles.min()):.0f} to {math.degrees(angles.max()):.0f} deg"
        text = f"{len(constant)} beams never change ({sector}, {np.median(table[:, constant]):.2f} m): own body"
        advice = "the self-filter must cover them: check the machine's outline and the mount"
        return [LogFinding(Severity.REMARK, self.topic, text, advice)]


def fatal_findings(topic: str, scans: Sequence[LaserScan]) -> list[LogFinding]:
    """Return what makes a scanner useless, of a sample of its scans."""
    beams = sum(len(scan.ranges_m) for scan in scans)
    share = sum(int(np.count_nonzero(_valid(scan.ranges_m, scan))) for scan in scans) / max(beams, 1)
    if share >= _DEAD_SHARE:
        return []
    text = f"dead: only {100 * share:.1f} % of the beams have a valid range"
    return [LogFinding(Severity.FATAL, topic, text, "check the scanner, its window and its range limits")]


def _valid(ranges: npt.NDArray[np.float32], scan: LaserScan) -> npt.NDArray[np.bool_]:
    """Return which ranges are hits: within the limits, and not the zero that some drivers give for no return."""
    return np.isfinite(ranges) & (ranges > 0.0) & (ranges >= scan.range_min_m) & (ranges <= scan.range_max_m)


def _stated_end(topic: str, scan: LaserScan, stated_rad: float | None) -> list[LogFinding]:
    """Compare the stated angle of the last beam with start, increment and number of beams."""
    size, increment = len(scan.ranges_m), scan.angle_increment_rad
    if stated_rad is None or size < 2 or increment == 0.0 or not math.isfinite(stated_rad):
        return []
    last_rad = scan.angle_min_rad + (size - 1) * increment
    off = (stated_rad - last_rad) / increment
    if abs(off) < 0.5:
        return []
    text = f"{size} beams of {math.degrees(increment):.3f} deg end at {math.degrees(last_rad):.2f} deg, "
    text += f"{math.degrees(stated_rad):.2f} deg is stated"
    if (stated_rad - scan.angle_min_rad) * increment < 0:
        text = f"the sign of the angle increment contradicts the stated end ({text})"
        advice = "start and increment are used: check whether the map is mirrored"
        return [LogFinding(Severity.PROBLEM, topic, text, advice)]
    severity = Severity.REMARK if abs(off) < 1.5 else Severity.PROBLEM
    return [LogFinding(severity, topic, text, "start and increment are used, the stated end is not")]


def _unusual_limits(topic: str, scan: LaserScan) -> list[LogFinding]:
    low, high = scan.range_min_m, scan.range_max_m
    if low < 0 or _MAX_RANGE_M < high < math.inf:
        return [LogFinding(Severity.REMARK, topic, f"the range limits are unusual ({low:g} to {high:g} m)")]
    return []


def _timing(topic: str, scan: LaserScan, period_s: float | None) -> list[LogFinding]:
    sweep_s = abs(scan.time_increment_s) * len(scan.ranges_m)
    if period_s and sweep_s > 1.1 * period_s:
        text = f"a sweep takes {sweep_s:.3f} s by its time increment, scans come each {period_s:.3f} s"
        advice = "the time increment is wrong: motion compensation would do harm"
        return [LogFinding(Severity.PROBLEM, topic, text, advice)]
    if sweep_s == 0.0:
        return [LogFinding(Severity.NOTE, topic, "no time increment: motion within a sweep is not compensated")]
    return []
