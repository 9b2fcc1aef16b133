"""What a machine did up to now: its states at a fixed rate, which is all that its sensors see of it.

A drive whose motion is known beforehand is a whole history at once; a stepped machine appends to one. Sensors read both
alike, so that both give the same bytes: where between two rows a stamp lies is reckoned in whole nanoseconds, and a stamp
on a row needs no row after it.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from lhdmap.messages import FloatArray

START_NS = 1_700_000_000_123_456_789
"""Stamp of the start of the clock, which is that of the first row."""
SECOND_NS = 1_000_000_000
_LEAST_ROWS = 1024


class Column(IntEnum):
    """Columns of a history, SI units: pose of `base_link` in `map` (yaw continuous), joints, speeds, what drives it.

    `SPEED` is that of the front axle along its heading, signed; `WHEEL_SPEED` that of the drive line; `TRACTION` the
    acceleration (m/s²) that the wheels' force would give the machine on a level and without resistance, signed along x;
    `LOAD` the mass in the bucket (kg); `CURL` the torque share (0 … 1) at which the tilt cylinder works against something;
    `TRANSMISSION`, `LIFT` and `TILT` the pressures (bar) of a machine that reckons them, 0 where the others say them.
    """

    X = 0
    Y = 1
    Z = 2
    ROLL = 3
    PITCH = 4
    YAW = 5
    ARTICULATION = 6
    SPEED = 7
    WHEEL_SPEED = 8
    ARTICULATION_RATE = 9
    BOOM = 10
    BUCKET = 11
    BOOM_RATE = 12
    BUCKET_RATE = 13
    TRACTION = 14
    LOAD = 15
    CURL = 16
    TRANSMISSION = 17
    LIFT = 18
    TILT = 19


class History:
    """Rows (N, 20) of the `Column`s at `rate_hz` (a whole number), the first at the start of the clock.

    A stepped run forgets what is older than `keep_s`.
    """

    def __init__(self, rate_hz: float, rows: FloatArray | None = None, *, keep_s: float = 5.0) -> None:
        self.rate_hz = rate_hz
        self._per_second = round(rate_hz)
        self._keep = max(int(keep_s * rate_hz), 2)
        self._rows = np.empty((_LEAST_ROWS, len(Column))) if rows is None else np.ascontiguousarray(rows, dtype=float)
        self._count = 0 if rows is None else len(rows)
        self._first = 0  # index of the first row that is kept, from the start of the clock

    def append(self, row: FloatArray) -> None:
        """Take the state of the next moment, shape (20,)."""
        if self._count == len(self._rows):
            self._make_room()
        self._rows[self._count] = row
        self._count += 1

    @property
    def last_s(self) -> float:
        """Time of the last row after the start of the clock, seconds."""
        return (self._first + self._count - 1) / self.rate_hz

    @property
    def last_ns(self) -> int:
        """Stamp of the last row."""
        return START_NS + (self._first + self._count - 1) * SECOND_NS // self._per_second

    @property
    def rows(self) -> FloatArray:
        """The rows that are kept, shape (N, 20): a view."""
        return self._rows[: self._count]

    @property
    def first_index(self) -> int:
        """Index of the first row of `rows`, counted from the start of the clock."""
        return self._first

    def split(self, stamp_ns: int) -> tuple[int, float]:
        """Return the row at or before a stamp (its place in `rows`) and the share of the step to the next; ends are held.

        Raises:
            ValueError: the row is forgotten: `keep_s` is shorter than what a sensor looks back.
        """
        index, rest = divmod((stamp_ns - START_NS) * self._per_second, SECOND_NS)
        index -= self._first
        if index < 0 and self._first > 0:
            raise ValueError(f"the state of {stamp_ns} ns is forgotten: keep_s must be larger")
        if index < 0 or index >= self._count - 1:
            return (0 if index < 0 else self._count - 1), 0.0
        return index, rest / SECOND_NS

    def state(self, stamp_ns: int) -> FloatArray:
        """Return the state at a stamp, shape (20,), linear between the rows, the ends held; raises as `split`."""
        index, share = self.split(stamp_ns)
        if share == 0.0:
            return self._rows[index].copy()
        return self._rows[index] * (1.0 - share) + self._rows[index + 1] * share

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return states at any times, shape (M, 20), linear in between, the ends held."""
        position = np.clip(np.asarray(time_s, dtype=float) * self.rate_hz - self._first, 0.0, self._count - 1.0)
        index = np.minimum(position.astype(np.int64), max(self._count - 2, 0))
        share = (position - index)[:, None]
        following = np.minimum(index + 1, self._count - 1)
        return self._rows[index] * (1.0 - share) + self._rows[following] * share

    def _make_room(self) -> None:
        kept = min(self._keep, self._count)
        rows = self._rows if 2 * kept <= len(self._rows) else np.empty((4 * kept, len(Column)))
        rows[:kept] = self._rows[self._count - kept : self._count]
        self._rows, self._first, self._count = rows, self._first + self._count - kept, kept
