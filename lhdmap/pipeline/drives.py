"""Which drives several logs hold: parts of one recording are one drive; another time, or another place after a pause, is another.

Parts of one recording follow each other within seconds, or hold different sensors of one time. After a longer pause the drive
goes on where the first scan looks like the last one before it, and else is another one, in one log too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lhdmap.logs.base import LogReader
from lhdmap.logs.formats import open_log
from lhdmap.logs.kinds import of_one_type
from lhdmap.logs.topics import roles_and_doubt
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.scan_matching.matching import Hits
from lhdmap.scan_matching.search import SearchGrid
from lhdmap.scan_matching.submap import Submap, unsure

PAUSE_S = 10.0
"""A pause of the scans after which a look is taken whether the machine still is where it was."""
_SHARED_S = 1.0  # parts of one recording share no more time than this
_RANGE_M, _BEAMS = 20.0, 300
_REACH, _LEAST_SUPPORT = np.array([1.5, 0.35]), 0.5
_FOREVER_NS, _MARGIN_NS = 1 << 62, 1_000_000_000  # other sensors may begin before the first scan
_GRID = SearchGrid(0.15, 0.05)


class LogDrive(NamedTuple):
    """Logs of one drive in the order of time; `window_ns`: what of them is of it, None: all."""

    logs: tuple[Path, ...]
    window_ns: tuple[int, int] | None = None


class _Log(NamedTuple):
    path: Path
    reader: LogReader
    start_ns: int
    end_ns: int
    has_front: bool


def drives_of(logs: Sequence[Path], topics: Mapping[str, str]) -> list[LogDrive]:
    """Return the drives in logs, in the order of the logs as they were given; raises InputError where one cannot be read."""
    with ExitStack() as stack:
        readers = [stack.enter_context(open_log(path)) for path in logs]
        known, _ = of_one_type(info for reader in readers for info in reader.topics().values())
        front = roles_and_doubt(known, {role: topic for role, topic in topics.items() if topic in known})[0].get(
            "front"
        )
        if front is None:
            return [LogDrive(tuple(logs))]  # of a 3D scanner, or nothing that can be used: the build tells
        opened = [_log(path, reader, front) for path, reader in zip(logs, readers, strict=True)]
        recordings = _recordings(opened)
        found = [drive for recording in recordings for drive in _parted(recording, front)]
    order = {path: number for number, path in enumerate(logs)}
    return sorted(found, key=lambda one: (min(order[path] for path in one.logs), one.window_ns or (0, 0)))


def _log(path: Path, reader: LogReader, front: str) -> _Log:
    has_front = front in reader.topics() and reader.topics()[front].count != 0
    return _Log(path, reader, reader.start_ns or 0, reader.end_ns or 0, has_front)


def _recordings(opened: Sequence[_Log]) -> list[list[_Log]]:
    """Return logs that share no time with another of the same sensor, in the order of time; others are drives of their own."""
    found: list[list[_Log]] = []
    for one in sorted((one for one in opened if one.has_front), key=lambda one: (one.start_ns, one.end_ns)):
        last = found[-1][-1] if found else None
        if last is None or one.start_ns < last.end_ns - _SHARED_S * 1e9:
            found.append([one])
        else:
            found[-1].append(one)
    for one in (
        one for one in opened if not one.has_front
    ):  # sensors of a recording that has them in a file of their own
        shared = [min(one.end_ns, of[-1].end_ns) - max(one.start_ns, of[0].start_ns) for of in found]
        found[int(np.argmax(shared))].append(one)
    return found


def _parted(recording: list[_Log], front: str) -> list[LogDrive]:
    """Return the drives of logs that follow each other: parted at pauses after which the scan is another."""
    paths = tuple(one.path for one in recording)
    pauses = list(_moved_in(recording, front))
    if not pauses:
        return [LogDrive(paths)]
    drives = []
    begins, ends = [0, *(after - _MARGIN_NS for _, after in pauses)], [*(before + _MARGIN_NS for before, _ in pauses)]
    for first, until in zip(begins, [*ends, _FOREVER_NS], strict=True):
        own = tuple(one.path for one in recording if one.start_ns < until and one.end_ns >= first)
        whole = all(first <= one.start_ns and one.end_ns < until for one in recording if one.path in own)
        drives.append(LogDrive(own, None if whole else (first, until)))
    return drives


def _moved_in(recording: list[_Log], front: str) -> Iterator[tuple[int, int]]:
    """Yield the log times of the last scan before and the first after each pause in which the machine was moved."""
    before: tuple[int, LaserScan] | None = None
    for one in recording:
        if not one.has_front or (one.end_ns - one.start_ns < PAUSE_S * 1e9 and len(recording) == 1):
            continue
        for _, logged_ns, scan in one.reader.records({front}):
            if not isinstance(scan, LaserScan):
                continue
            if before is not None and logged_ns - before[0] > PAUSE_S * 1e9 and not same_place(before[1], scan):
                yield before[0], logged_ns
            before = logged_ns, scan


def same_place(before: LaserScan, after: LaserScan) -> bool:
    """Return whether two scans of one scanner are of about one place."""
    first, second = _points(before), _points(after)
    if min(len(first), len(second)) < 20:
        return True  # nothing tells
    walls = Submap.of(first, 0.05, grid=_GRID, window_cells=1024)
    best = next(iter(walls.locate(Hits(second, len(second), layered=False), unsure(np.zeros(3)), _REACH)), None)
    return best is not None and best.support >= _LEAST_SUPPORT


def _points(scan: LaserScan) -> FloatArray:
    """Return hits (N, 3) in the scanner's plane, near ones, thinned."""
    ranges = np.asarray(scan.ranges_m, dtype=float)
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(ranges))
    near = np.isfinite(ranges) & (ranges > scan.range_min_m) & (ranges < _RANGE_M)
    ranges, angles = ranges[near], angles[near]
    points = np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(ranges))])
    thinned: FloatArray = points[:: max(len(points) // _BEAMS, 1)]
    return thinned
