"""Curves of a run of any length in bounded memory: when there are too many rows, every other one goes."""

from __future__ import annotations

from array import array

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.replay.journal import Event
from lhdmap.report.replay_data import Change

MOST_ROWS, MOST_CHANGES = 20_000, 2_000

_PARTS = ("modes", "watchdog", "guard")


class Series:
    """Rows of `width` figures, evenly thinned; at most `most` are kept."""

    def __init__(self, width: int, most: int = MOST_ROWS) -> None:
        self._width, self._most, self._step, self._seen = width, most, 1, 0
        self._values = array("d")
        self._last: tuple[float, ...] = ()

    def add(self, row: tuple[float, ...]) -> None:
        """Take a row, or leave it out."""
        self._last = row
        if self._seen % self._step == 0:
            self._values.extend(row)
            if len(self._values) >= self._most * self._width:
                kept = self._rows()[::2]
                self._values, self._step = array("d", kept.ravel().tobytes()), 2 * self._step
        self._seen += 1

    def rows(self) -> FloatArray:
        """Return what is kept, shape (N, width), the last row in any case."""
        rows = self._rows()
        if self._last and (not len(rows) or rows[-1, 0] != self._last[0]):
            rows = np.vstack([rows, self._last])
        return rows

    def _rows(self) -> FloatArray:
        return np.array(self._values, dtype=float).reshape(-1, self._width)


class Timeline:
    """Changes of state of all processes, the first `MOST_CHANGES` of each; a listener of the journal."""

    def __init__(self, most: int = MOST_CHANGES) -> None:
        self.changes: dict[str, list[Change]] = {}
        self.left_out = 0
        self._most = most

    def __call__(self, event: Event) -> None:
        """Take an event; only changes of state count."""
        lane, state = (event.process, event.after) if event.event == "state" else _part(event)
        if not state:
            return
        changes = self.changes.setdefault(lane, [])
        if changes and changes[-1].state == state:
            return
        if len(changes) >= self._most:
            self.left_out += 1
            return
        changes.append(Change(event.t_ns, state, event.cause))


def _part(event: Event) -> tuple[str, str]:
    """Return a part of the executor that has states of its own, and which one it is in now; nothing of other events."""
    who, _, _ = event.event.partition(": ")
    return (who, str(event.values.get("after", ""))) if who in _PARTS else ("", "")
