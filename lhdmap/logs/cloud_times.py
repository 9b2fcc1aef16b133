"""The times of the points within a cloud, as drivers give them: unit, clock and sign found out, nonsense replaced.

A sweep is over before the next one begins, so its points lie in a window of one period: what is outside of it is no time of
this sweep. Neither are times that leap away from those of the points before and behind in the cloud. Such points get the
time of their neighbours; a cloud in which they are the most, or whose sweep outlasts its period, has no times.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray

Mask = npt.NDArray[np.bool_]

_LONGEST_S, _USUAL_S = 1.0, 0.25  # no scanner turns slower; hardly one does
_LONGER = 1.2  # than the longest of the last steps from cloud to cloud
_STEPS = 9
_MOST_FRAMES = 64
_SAMPLED = 1024
_LEAP = 0.1  # of a sweep
_PASSES = 4
_MOST_LEAPS, _FEWEST_STEADY = 0.05, 0.6  # of the points
_MOST_BESIDE = 0.25
_FEW_POINTS = 32
_NEAR_S = 2.0  # a clock that is as near to the stamp is the stamp's
_LEAST_S = 1e-3  # shorter sweeps are no reason for a unit that is not the usual one
_NONE: Float32Array = np.empty(0, np.float32)
_UNITS = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}


class _Clock(Enum):
    OFFSET, STAMP, OTHER = range(3)


class _Told(NamedTuple):
    """Times as found (N,), seconds, which are times of the sweep (N,), and from when they count."""

    times_s: FloatArray
    good: Mask
    clock: _Clock


class CloudTimes:
    """Turns the raw times of a topic's clouds into seconds after the stamp; `remarks` tells what was odd."""

    def __init__(self) -> None:
        self._last_ns: dict[str, int] = {}
        self._steps_s: dict[str, deque[float]] = {}
        self._widths: deque[float] = deque(maxlen=_STEPS)
        self._unit = ""  # where it is neither the usual one nor confirmed by the stamp
        self._clouds = self._foreign = self._without = self._alike = 0
        self._points = self._wrapped = self._odd = 0
        self._worst_s = 0.0

    def seconds(self, raw: npt.NDArray[Any], stamp_ns: int, frame: str) -> Float32Array:
        """Return the times (N,) of the points after the stamp, or (0,) where they say nothing.

        `raw`: the times as in the message (N,), integers (nanoseconds, or microseconds) or floats (seconds, or finer),
        after the stamp or absolute.
        """
        window_s = self._window_s(stamp_ns, frame)
        if not len(raw):
            return _NONE
        self._clouds += 1
        self._points += len(raw)
        with np.errstate(over="ignore", invalid="ignore"):
            values = _signed(raw)
            finite = np.isfinite(values)
            told = self._read(values, finite, raw.dtype.kind, window_s, stamp_ns) if finite.any() else None
            if told is None:
                self._without += 1
                return _NONE
            self._wrapped += _below_zero(raw, told)
            return self._filled(told)

    def remarks(self, topic: str) -> list[str]:
        """Return what was odd, one line each."""
        its, bare = f"{topic}: the times of its points", "not used, motion within a sweep is not compensated there"
        lines = [f"{its} are taken as {self._unit}"] if self._unit else []
        if self._foreign:
            lines.append(f"{its} are those of another clock; they count from the first point of a cloud on")
        if self._wrapped:
            lines.append(f"{its} are wrapped below zero for {self._share(self._wrapped)} of the points; read as signed")
        if self._odd:
            off = f"up to {self._worst_s:.3g} s off" if self._worst_s else "no numbers"
            lines.append(
                f"{its} are nonsense for {self._share(self._odd)} of the points ({off}); "
                "the times of the points beside them are taken"
            )
        if self._without:
            lines.append(f"{its} are not those of a sweep in {self._without} of {self._clouds} clouds; {bare}")
        if self._alike:
            lines.append(f"{its} are all the same in {self._alike} of {self._clouds} clouds; {bare}")
        return lines

    def _window_s(self, stamp_ns: int, frame: str) -> float:
        """Return the longest time that a sweep of this scanner can last."""
        frame = frame if frame in self._steps_s or len(self._steps_s) < _MOST_FRAMES else ""
        steps_s = self._steps_s.setdefault(frame, deque(maxlen=_STEPS))
        step_s = (stamp_ns - self._last_ns.get(frame, stamp_ns)) * 1e-9
        self._last_ns[frame] = stamp_ns
        if step_s > 0.0:
            steps_s.append(step_s)
        longest_s = _LONGER * max(steps_s, default=0.0)
        if len(steps_s) < _STEPS:  # clouds may come in bunches
            longest_s = max(longest_s, _USUAL_S)
        return min(longest_s, _LONGEST_S)

    def _read(self, values: FloatArray, finite: Mask, kind: str, window_s: float, stamp_ns: int) -> _Told | None:
        """Return the times of a cloud, None where they are those of more than a sweep."""
        self._widths.append(2.0 * _half_width(values[finite]))
        width = float(np.median(self._widths))
        unit = _unit(kind, width, window_s)
        steady = _steady(values, finite, _LEAP * width)
        first, good = _densest(values, steady, window_s / unit)
        if np.count_nonzero(good) <= 0.5 * len(values) or _outlasts(values[steady], first, window_s / unit):
            return None
        told = _told((values - first) * unit, good, first * unit, stamp_ns * 1e-9, window_s)
        self._foreign += told.clock is _Clock.OTHER
        usual = 1e-9 if kind in "iu" else 1.0
        self._unit = "" if unit == usual or told.clock is _Clock.STAMP else _UNITS[unit]
        return told

    def _filled(self, told: _Told) -> Float32Array:
        """Return the times, those of the odd points from the points beside them in the cloud."""
        times, kept, odd = told.times_s, np.flatnonzero(told.good), np.flatnonzero(~told.good)
        if len(times) >= _FEW_POINTS and np.ptp(times[kept]) == 0.0:
            self._alike += 1
            return _NONE
        if len(odd):
            filled = np.interp(odd, kept, times[kept])
            off_s = np.abs(times[odd] - filled)
            self._odd += len(odd)
            self._worst_s = max(self._worst_s, float(np.max(off_s[np.isfinite(off_s)], initial=0.0)))
            times[odd] = filled
        return times.astype(np.float32)

    def _share(self, count: int) -> str:
        share = 100.0 * count / max(self._points, 1)
        return f"{share:.0f} %" if share >= 1.0 else f"{share:.2g} %"


def _signed(raw: npt.NDArray[Any]) -> FloatArray:
    """Return the counts as float64; a 32-bit counter that wraps within the cloud, or below zero, runs on."""
    if raw.dtype.kind != "u" or raw.dtype.itemsize != 4:
        return raw.astype(np.float64)
    counts = raw.astype(np.uint32)
    sampled = np.sort(counts[:: max(len(counts) // _SAMPLED, 1)])
    middle = sampled[len(sampled) // 2 :][:1]
    after, first = (counts - middle).view(np.int32), middle.view(np.int32)
    return after.astype(np.float64) + first.astype(np.float64)


def _half_width(values: FloatArray) -> float:
    """Return the length of the shortest stretch that holds half of the values: what a few wild ones cannot move."""
    ordered = np.sort(values[:: max(len(values) // _SAMPLED, 1)])
    half = len(ordered) // 2
    return float(np.min(ordered[half:] - ordered[: len(ordered) - half]))


def _unit(kind: str, width: float, window_s: float) -> float:
    """Return seconds per count: the coarsest unit in which a sweep of this width fits into the window."""
    coarse = [1.0, 1e-3, 1e-6]
    if kind in "iu":  # nanoseconds, but for drivers that count microseconds
        coarse = [1e-6] if width * 1e-6 >= _LEAST_S else []
    return next((unit for unit in coarse if width * unit <= window_s), 1e-9)


def _densest(values: FloatArray, finite: Mask, window: float) -> tuple[float, Mask]:
    """Return the first value of the window that holds the most values, and which lie in it (N,)."""
    found = values[finite]
    first, last = float(found.min()), float(found.max())
    if last - first <= window:
        return first, finite
    ordered = np.sort(found)
    held = np.searchsorted(ordered, ordered + window, side="right") - np.arange(len(ordered))
    first = float(ordered[int(np.argmax(held))])
    return first, finite & (values >= first) & (values <= first + window)


def _outlasts(steady: FloatArray, first: float, window: float) -> bool:
    """Return whether the sweep goes on beyond the window: many points are just before or behind it."""
    near = (steady >= first - window) & (steady <= first + 2.0 * window)
    beside = near & ~((steady >= first) & (steady <= first + window))
    return bool(np.count_nonzero(beside) > _MOST_BESIDE * len(steady))


def _told(after_s: FloatArray, good: Mask, start_s: float, stamp_s: float, window_s: float) -> _Told:
    """Return the times after the stamp; `after_s` (N,) count from `start_s` on, the first time of the sweep as it stands."""
    if abs(start_s) <= 1.5 * window_s:
        return _Told(after_s + start_s, good, _Clock.OFFSET)
    if abs(start_s - stamp_s) <= _NEAR_S:
        return _Told(after_s + (start_s - stamp_s), good, _Clock.STAMP)
    return _Told(after_s, good, _Clock.OTHER)


def _below_zero(raw: npt.NDArray[Any], told: _Told) -> int:
    """Return how many times are negative in a field that has no sign."""
    if raw.dtype.kind != "u" or told.clock is not _Clock.OFFSET:
        return 0
    return int(np.count_nonzero(told.times_s[told.good] < 0.0))


def _steady(values: FloatArray, finite: Mask, least: float) -> Mask:
    """Return which values (N,) do not leap by more than `least` away from those before and behind them in the cloud.

    All do not where many leap all the same: then the order of the points is not that of time.
    """
    kept = np.flatnonzero(finite)
    for _ in range(_PASSES):
        odd = _odd_stretches(values[kept], least)
        if not odd.any():
            break
        kept = kept[~odd]
    leaps = np.count_nonzero(np.abs(np.diff(values[kept])) > least)
    if leaps > _MOST_LEAPS * len(kept) or len(kept) < _FEWEST_STEADY * len(values):
        return finite
    steady = np.zeros(len(values), dtype=bool)
    steady[kept] = True
    return steady


def _odd_stretches(times: FloatArray, least: float) -> Mask:
    """Return which values (N,) are in a stretch that leaps away from those before and behind it, which fit each other.

    Those are more than the stretch. Clouds that are sorted by ring leap, too, from the end of a ring to the start of the next
    one: but those before and behind a ring do not fit each other.
    """
    ends = np.flatnonzero(np.abs(np.diff(times)) > least)  # last points of stretches
    if len(ends) < 2:
        return np.zeros(len(times), dtype=bool)
    before, behind = times[ends[:-1]], times[ends[1:] + 1]
    leap = np.minimum(np.abs(times[ends[:-1] + 1] - before), np.abs(times[ends[1:]] - behind))
    lengths = np.diff(ends, prepend=-1, append=len(times) - 1)
    short = lengths[1:-1] < 0.5 * (lengths[:-2] + lengths[2:])
    odd = short & (np.abs(behind - before) < 0.5 * leap)
    return np.repeat(np.concatenate(([False], odd, [False])), lengths)
