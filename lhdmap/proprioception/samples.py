"""Bounded buffers of timed samples, and the warnings that streams of them give rise to."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

BACKWARD_RUN = 20  # so many samples in a row that are older than the newest: the clock was set back


class Warnings:
    """Collects warnings of a stage; each text once, with how often it came."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def add(self, text: str) -> None:
        """Count a warning."""
        self._counts[text] += 1

    def texts(self) -> list[str]:
        """Return the warnings in the order of their first appearance."""
        return [text if n == 1 else f"{text} ({n} times)" for text, n in self._counts.items()]


class SampleBuffer:
    """The samples of the last `keep_s` seconds: rising stamps and a row of `width` values each.

    A stamp that does not rise is refused with a warning; after a long run of such the clock is taken to have been set
    back, and the buffer starts anew. Rows that are not finite are refused with a warning.
    """

    def __init__(self, name: str, width: int, keep_s: float, warnings: Warnings) -> None:
        self.name = name
        self.warnings = warnings
        self._keep_ns = round(keep_s * 1e9)
        self._stamps = np.empty(256, dtype=np.int64)
        self._rows = np.empty((256, width))
        self.latest_ns: int | None = None
        self.latest_row: tuple[float, ...] = ()
        self._first = self._last = 0
        self._backward = 0

    def __len__(self) -> int:
        return self._last - self._first

    @property
    def stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps, shape (N,), rising. A view: not to be written to or kept."""
        return self._stamps[self._first : self._last]

    @property
    def rows(self) -> FloatArray:
        """Values, shape (N, width). A view: not to be written to or kept."""
        return self._rows[self._first : self._last]

    def append(self, stamp_ns: int, row: tuple[float, ...]) -> bool:
        """Take a sample; return whether it was taken."""
        if not all(map(math.isfinite, row)):
            self.warnings.add(f"{self.name}: a sample is not finite; left out")
            return False
        if self.latest_ns is not None and stamp_ns <= self.latest_ns and not self._set_back():
            return False
        self._backward = 0
        if self._last == len(self._stamps):
            self._make_room(stamp_ns)
        self._stamps[self._last] = stamp_ns
        self._rows[self._last] = row
        self._last += 1
        self.latest_ns, self.latest_row = stamp_ns, row
        return True

    def clear(self) -> None:
        """Forget all samples."""
        self._first = self._last = 0
        self.latest_ns, self.latest_row = None, ()

    def _set_back(self) -> bool:
        self._backward += 1
        self.warnings.add(f"{self.name}: stamps repeat or run backwards; such samples are left out")
        if self._backward < BACKWARD_RUN:
            return False
        self.warnings.add(f"{self.name}: the clock was set back; earlier samples are forgotten")
        self.clear()
        return True

    def _make_room(self, stamp_ns: int) -> None:
        """Drop what is older than `keep_s`; double the arrays where that leaves them more than half full."""
        self._first += int(np.searchsorted(self.stamps_ns, stamp_ns - self._keep_ns))
        n = len(self)
        size = len(self._stamps) * (2 if 2 * n > len(self._stamps) else 1)
        stamps, rows = np.empty(size, dtype=np.int64), np.empty((size, self._rows.shape[1]))
        stamps[:n], rows[:n] = self.stamps_ns, self.rows
        self._stamps, self._rows, self._first, self._last = stamps, rows, 0, n
