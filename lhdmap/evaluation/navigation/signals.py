"""What a log says of a drive: speed, articulation, commands and mode over time, from its messages; nothing is assumed.

Samples that are not finite are left out; across a gap of more than `MAX_GAP_S` nothing is known.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import Command, FloatArray, Joints, Message, Tachometer, Text

ROLES = ("tachometer", "joints", "command", "mode")
MAX_GAP_S = 0.5
_NAMES = ("speed", "articulation", "propel", "steering", "mode")
_FAR_NS = 600_000_000_000  # a mode told once may be this old when the sensors begin
MODES = ("idle", "autonomous", "teleoperated", "assisted", "manual")


class Series(NamedTuple):
    """Samples over time: `time_s` (N,) rising, `values` (N,) finite."""

    time_s: FloatArray
    values: FloatArray

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return values at times (M,) on the lines between samples; NaN across gaps, and farther outside than one."""
        if len(self.time_s) == 0:
            return np.full(len(time_s), np.nan)
        after = np.clip(np.searchsorted(self.time_s, time_s), 1, max(len(self.time_s) - 1, 1))
        before = after - 1
        near = self.time_s[np.minimum(after, len(self.time_s) - 1)] - self.time_s[before] <= MAX_GAP_S
        near &= (time_s >= self.time_s[0] - MAX_GAP_S) & (time_s <= self.time_s[-1] + MAX_GAP_S)
        return np.where(near, np.interp(time_s, self.time_s, self.values), np.nan)

    def held(self, time_s: FloatArray) -> FloatArray:
        """Return the newest value at times (M,), as an actuator holds it; NaN where it is older than the largest gap."""
        if len(self.time_s) == 0:
            return np.full(len(time_s), np.nan)
        row = np.searchsorted(self.time_s, time_s, side="right") - 1
        fresh = (row >= 0) & (time_s - self.time_s[np.maximum(row, 0)] <= MAX_GAP_S)
        return np.where(fresh, self.values[np.maximum(row, 0)], np.nan)


class Signals(NamedTuple):
    """A drive: times are seconds after `start_ns`. `mode`: row in `MODES` by time of change, empty where not recorded."""

    start_ns: int
    length_s: float
    speed_mps: Series
    articulation_rad: Series
    propel: Series
    steering_rate_rps: Series
    mode: Series
    remarks: tuple[str, ...] = ()

    def mode_at(self, time_s: FloatArray) -> npt.NDArray[np.object_]:
        """Return the mode at times (M,): the last one told, before the first the first; empty texts where none was."""
        if len(self.mode.time_s) == 0:
            return np.full(len(time_s), "", dtype=object)
        row = np.maximum(np.searchsorted(self.mode.time_s, time_s, side="right") - 1, 0)
        return np.array(MODES, dtype=object)[self.mode.values[row].astype(int)]


class SignalCollector:
    """Takes the messages of a log in any order; `signals` gives them as series."""

    def __init__(self) -> None:
        self._samples: dict[str, list[tuple[int, float]]] = {name: [] for name in _NAMES}
        self._odd: Counter[str] = Counter()

    def update(self, message: Message) -> None:
        """Take one message; those of other kinds than needed are passed over."""
        match message:
            case Tachometer():
                self._add("speed", message.stamp_ns, message.speed_mps)
            case Joints():
                if "articulation" in message.positions_rad:
                    self._add("articulation", message.stamp_ns, message.positions_rad["articulation"])
            case Command():
                self._add("propel", message.stamp_ns, message.propel)
                self._add("steering", message.stamp_ns, message.steering_rate_rps)
            case Text():
                self._add_mode(message)

    def _add(self, name: str, stamp_ns: int, value: float) -> None:
        if math.isfinite(value):
            self._samples[name].append((stamp_ns, value))
        else:
            self._odd[f"{name}: samples that are not finite were left out"] += 1

    def _add_mode(self, message: Text) -> None:
        word = message.text.strip().lower()
        if word in MODES:
            self._samples["mode"].append((message.stamp_ns, MODES.index(word)))
        else:
            self._odd[f"mode '{word[:40]}' is none of {', '.join(MODES)}; left out"] += 1

    def signals(self, length_s: float = 0.0, start_ns: int = 0) -> Signals:
        """Return the series; start and length are those given where no message has told of any."""
        ends = [(min(rows)[0], max(rows)[0]) for name, rows in self._samples.items() if rows and name != "mode"]
        if ends:
            start_ns, end_ns = min(first for first, _ in ends), max(last for _, last in ends)
            length_s = (end_ns - start_ns) * 1e-9
            self._check_clock(start_ns, end_ns)
        rows = {name: _series(samples, start_ns) for name, samples in self._samples.items()}
        remarks = tuple(f"{text} ({count})" for text, count in self._odd.items())
        speed, angle, propel, steering, mode = (rows[name] for name in _NAMES)
        return Signals(start_ns, length_s, speed, angle, propel, steering, mode, remarks)

    def _check_clock(self, start_ns: int, end_ns: int) -> None:
        """Leave the mode out where its stamps (it has no header, so the recorder's) are of another clock."""
        modes = self._samples["mode"]
        if modes and (min(modes)[0] > end_ns or max(modes)[0] < start_ns - _FAR_NS):
            self._odd["mode: stamped by another clock than the sensors; left out"] += len(modes)
            modes.clear()


def _series(samples: list[tuple[int, float]], start_ns: int) -> Series:
    """Return samples sorted by stamp, of equal stamps the last one."""
    if not samples:
        return Series(np.empty(0), np.empty(0))
    stamps = np.array([stamp for stamp, _ in samples], dtype=np.int64)
    values = np.array([value for _, value in samples], dtype=float)
    order = np.argsort(stamps, kind="stable")
    stamps, values = stamps[order], values[order]
    last = np.append(np.diff(stamps) > 0, True)
    return Series((stamps[last] - start_ns) * 1e-9, values[last])
