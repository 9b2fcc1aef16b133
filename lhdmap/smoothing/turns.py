"""What a gyroscope said of the turn at each processed scan, packed: a shift has a million of them."""

from __future__ import annotations

from array import array

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

_WIDTH = 2


class Turns:
    """A list of (time, turn since the first reading (rad), seconds of it that are not known), in the order of time."""

    def __init__(self) -> None:
        self._times, self._rows = array("q"), array("d")

    def __len__(self) -> int:
        return len(self._times)

    def append(self, time_ns: int, row: FloatArray) -> None:
        """Add what was said at a time, `row` (2,); NaN where nothing was."""
        self._times.append(time_ns)
        self._rows.extend(row.tolist())

    def at(self, times_ns: npt.NDArray[np.int64]) -> FloatArray:
        """Return the rows (N, 2) at other times, linear between; NaN beyond the ends and where nothing is known."""
        known = np.array(self._times, dtype=np.int64)
        if not len(known):
            return np.full((len(times_ns), _WIDTH), np.nan)
        rows = np.array(self._rows, dtype=float).reshape(-1, _WIDTH)
        x, at = (known - known[0]).astype(float), (times_ns - known[0]).astype(float)
        return np.column_stack([np.interp(at, x, column, np.nan, np.nan) for column in rows.T])
