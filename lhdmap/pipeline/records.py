"""What the pipeline keeps of each scan for tables and curves: a few numbers, never the scan.

They are packed: as Python objects they would take five times the memory, more than a gibibyte in a shift.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.report.data import AngleSeries, SpeedSeries

_MATCH, _MOTION = (
    9,
    3,
)  # numbers a row: residual, support, information (3), slip, deviations (3); both speeds, articulation


class ScanRecords:
    """One row a scan of the front scanner (stamp, time) and one row a processed scan (diagnostics).

    Not `kept`: the newest of both alone.
    """

    def __init__(self, *, kept: bool = True) -> None:
        self._kept = kept
        self._stamps_ns, self._times_ns, self._processed_ns, self._moved_ns = (array("q") for _ in range(4))
        self._matches, self._motions = array("d"), array("d")
        self._degenerate, self._lost = array("b"), array("b")
        self._substitutes, self._wheels = _Words(), _Words()

    def add_scan(self, stamp_ns: int, time_ns: int) -> None:
        """Count a scan; `time_ns` is its stamp made rising."""
        if not self._kept:
            _empty(self._stamps_ns, self._times_ns)
        self._stamps_ns.append(stamp_ns)
        self._times_ns.append(time_ns)

    def add_processed(
        self,
        stamp_ns: int,
        match: tuple[float, float],
        found: tuple[FloatArray, FloatArray],
        substitute: str,
        flags: tuple[bool, bool],
        wheels: tuple[str, float],
    ) -> None:
        """Add a processed scan: match (residual m, support), flags (degenerate, lost), wheels (use, slip).

        `found`: information (3,), and standard deviations (3,) of what the step adds to the error of the path.
        """
        if not self._kept:
            _empty(self._processed_ns, self._moved_ns, self._matches, self._motions, self._degenerate, self._lost)
            _empty(self._substitutes.rows, self._wheels.rows)
        self._processed_ns.append(stamp_ns)
        self._matches.extend((*match, *found[0].tolist(), wheels[1], *found[1].tolist()))
        self._substitutes.append(substitute)
        self._wheels.append(wheels[0])
        self._degenerate.append(bool(flags[0]))
        self._lost.append(bool(flags[1]))

    def add_motion(
        self, time_ns: int, speed_mps: float, wheel_mps: float | None, articulation_rad: float | None
    ) -> None:
        """Add speed, wheel speed and articulation of a processed scan."""
        known = (speed_mps, wheel_mps, articulation_rad)
        self._moved_ns.append(time_ns)
        self._motions.extend(math.nan if value is None else value for value in known)

    @property
    def scans(self) -> int:
        """Number of scans."""
        return len(self._stamps_ns)

    @property
    def stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of the scans, shape (N,); a copy."""
        return _integers(self._stamps_ns)

    @property
    def times_ns(self) -> npt.NDArray[np.int64]:
        """The same made rising, shape (N,); a copy."""
        return _integers(self._times_ns)

    @property
    def processed(self) -> int:
        """Number of processed scans."""
        return len(self._processed_ns)

    @property
    def lost_stretches(self) -> int:
        """Number of runs of scans that could not be placed."""
        lost = np.concatenate([[False], _flags(self._lost)])
        return int(np.count_nonzero(lost[1:] & ~lost[:-1]))

    @property
    def lost_now(self) -> bool:
        """Whether the last processed scan did not match."""
        return bool(self._lost) and bool(self._lost[-1])

    @property
    def weak_now(self) -> bool:
        """Whether the last processed scan left a direction unobserved."""
        return bool(self._degenerate) and bool(self._degenerate[-1])

    @property
    def all_lost(self) -> bool:
        """Whether none of the scans after the first could be placed."""
        return len(self._lost) > 1 and all(self._lost[1:])

    @property
    def degenerate_share(self) -> float:
        """Share of processed scans with an unobserved direction."""
        return float(_flags(self._degenerate).mean()) if self.processed else 0.0

    def diagnostics(self) -> Diagnostics:
        """Return the table of the map folder."""
        residual, support, along, across, heading, slip, *std = _rows(self._matches, _MATCH).T
        return Diagnostics(
            _integers(self._processed_ns),
            residual,
            support,
            along,
            across,
            heading,
            _flags(self._degenerate),
            self._substitutes.all(),
            slip,
            self._wheels.all(),
            *std,
        )

    def speed(self) -> SpeedSeries | None:
        """Return the odometry's speed."""
        return self._speed(0)

    def tachometer(self) -> SpeedSeries | None:
        """Return the wheels' speed, or None where the log has none."""
        return self._speed(1)

    def articulation(self) -> AngleSeries | None:
        """Return the articulation angle, or None where the log has none."""
        times, values = self._series(2)
        return AngleSeries(times, values) if len(times) else None

    def _speed(self, column: int) -> SpeedSeries | None:
        times, values = self._series(column)
        return SpeedSeries(times, values) if len(times) else None

    def _series(self, column: int) -> tuple[npt.NDArray[np.int64], FloatArray]:
        values = _rows(self._motions, _MOTION)[:, column]
        known = np.isfinite(values)
        return _integers(self._moved_ns)[known], values[known]


class _Words:
    """Words of a small vocabulary, a byte each."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self.rows = array("B")

    def append(self, word: str) -> None:
        self.rows.append(self._numbers.setdefault(str(word), len(self._numbers)))

    def all(self) -> list[str]:
        words = list(self._numbers)
        return [words[number] for number in self.rows]


def _empty(*packed: array[Any]) -> None:
    for one in packed:
        del one[:]


def _integers(packed: array[int]) -> npt.NDArray[np.int64]:
    """Return a copy (N,): while an array is looked at, it cannot grow."""
    return np.array(packed, dtype=np.int64)


def _flags(packed: array[int]) -> npt.NDArray[np.bool_]:
    return np.array(packed, dtype=np.int8).astype(np.bool_)


def _rows(packed: array[float], width: int) -> FloatArray:
    return np.array(packed, dtype=np.float64).reshape(-1, width)
