"""BreezySLAM's `.dat` logs: one scan a line, with wheel encoders (Mines ParisTech rover).

A line holds the time (microseconds), at 2 and 3 the ticks of the left and right encoder, at 24 to 705 682 ranges in
millimetres (0: none) of a URG-04LX over 240 degrees, from right to left. Wheel radius 77 mm, half axle 165 mm, 2000
ticks a turn (BreezySLAM's mines example).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.logs.base import TopicInfo
from lhdmap.logs.findings import Findings
from lhdmap.logs.text.lines import text_lines
from lhdmap.logs.text.log import FoundLine, TextLog, Wanted, every
from lhdmap.messages import Float32Array, LaserScan, WheelPose
from lhdmap.roles import ODOMETRY, SCAN

WORDS, FIRST_RANGE, BEAMS = 706, 24, 682
_FOV_RAD = math.radians(240.0)
_RANGE_MAX_M = 5.6
_WHEEL_RADIUS_M, _HALF_AXLE_M, _TICKS_A_TURN = 0.077, 0.165, 2000
_SCAN, _ODOMETRY = "scan", "odom"


class _Line(NamedTuple):
    stamp_ns: int
    left_ticks: int
    right_ticks: int
    ranges_m: Float32Array


class BreezyLog(TextLog):
    """A `LogReader` of a BreezySLAM log."""

    format = "BreezySLAM log"

    def _survey(self) -> None:
        self._count = 0
        for words in text_lines(self.path, Findings()):
            try:
                line = _parsed(words.split())
            except InputError:
                continue
            self._count += 1
            self._start_ns = line.stamp_ns if self._start_ns is None else min(self._start_ns, line.stamp_ns)
            self._end_ns = line.stamp_ns if self._end_ns is None else max(self._end_ns, line.stamp_ns)
        if not self._count:
            raise InputError(f"{self.path}: no line of a BreezySLAM log in it; {WORDS} numbers a line were wanted")

    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics by name."""
        return {
            _SCAN: TopicInfo(_SCAN, SCAN, self._count, "laser"),
            _ODOMETRY: TopicInfo(_ODOMETRY, ODOMETRY, self._count, "odom"),
        }

    def _messages(self, topics: Collection[str], wanted: Wanted = every) -> Iterator[FoundLine]:
        wheels = _Wheels()
        for text in self._lines():
            try:
                line = _parsed(text.split())
            except InputError as error:
                self._notes_damage(f"a line was skipped: {error}")
                continue
            pose = wheels.update(line)
            if _ODOMETRY in topics and wanted(_ODOMETRY):
                yield FoundLine(_ODOMETRY, line.stamp_ns, pose, True)
            if _SCAN in topics and wanted(_SCAN):
                yield FoundLine(_SCAN, line.stamp_ns, _scan(line), True)


class _Wheels:
    """Dead reckoning of a differential drive from encoder ticks."""

    def __init__(self) -> None:
        self._last: _Line | None = None
        self._x_m = self._y_m = self._heading_rad = 0.0

    def update(self, line: _Line) -> WheelPose:
        last, self._last = self._last or line, line
        metres = 2.0 * math.pi * _WHEEL_RADIUS_M / _TICKS_A_TURN
        left_m = (line.left_ticks - last.left_ticks) * metres
        right_m = (line.right_ticks - last.right_ticks) * metres
        turn_rad = (right_m - left_m) / (2.0 * _HALF_AXLE_M)
        middle_rad = self._heading_rad + 0.5 * turn_rad
        self._x_m += 0.5 * (left_m + right_m) * math.cos(middle_rad)
        self._y_m += 0.5 * (left_m + right_m) * math.sin(middle_rad)
        self._heading_rad += turn_rad
        return WheelPose(line.stamp_ns, self._x_m, self._y_m, self._heading_rad)


def _scan(line: _Line) -> LaserScan:
    increment = _FOV_RAD / (BEAMS - 1)
    return LaserScan(line.stamp_ns, "laser", -0.5 * _FOV_RAD, increment, 0.0, 0.02, _RANGE_MAX_M, line.ranges_m)


def _parsed(words: list[bytes]) -> _Line:
    if len(words) < WORDS:
        raise InputError(f"{len(words)} of {WORDS} numbers")
    try:
        time_us, left, right = int(words[0]), int(words[2]), int(words[3])
        ranges_mm = np.array(words[FIRST_RANGE : FIRST_RANGE + BEAMS], dtype=bytes).astype(np.int64)
    except ValueError:
        raise InputError("a word that is no whole number") from None
    if not 0 <= time_us < 1 << 53 or max(abs(left), abs(right)) >= 1 << 53:
        raise InputError("a number that is impossible")
    ranges_m = np.where(ranges_mm > 0, ranges_mm / 1000.0, np.inf).astype(np.float32)
    return _Line(time_us * 1000, left, right, ranges_m)
