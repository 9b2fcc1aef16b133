"""Where key scans are: how often a place was seen, so that memory grows with the map and not with the drive, and which are near.

A machine that drives the same drifts all day passes each place a thousand times. Some visits fix it; of the later ones a few keys
in a row, now and then, tie the path to it: between them the odometry drifts by millimetres.
"""

from __future__ import annotations

import math
from array import array

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

_WIDE_KEYS = 2.0  # width of a place, in steps from key to key
_ENOUGH = 8  # keys in a place: four visits
_LAYER_M = 3.0  # levels of a mine are farther apart, drifts of the height over some visits smaller
_SECTORS = 4  # a machine that comes the other way sees other walls
_APART_M, _RUN_KEYS = 40.0, 2.5  # closures count when their neighbours say the same


class Places:
    """Counts the keys of each place: position, level and direction, by the odometry."""

    def __init__(self, key_m: float) -> None:
        self._width_m, self._run_m = _WIDE_KEYS * key_m, _RUN_KEYS * key_m
        self._keys: dict[tuple[int, int, int, int], int] = {}

    def wants(self, pose: FloatArray, height_m: float, travelled_m: float) -> bool:
        """Take a key at a pose (3,) if the place still wants one; return whether it did."""
        x, y, heading = pose.tolist()
        sector = round(heading / (2.0 * math.pi / _SECTORS)) % _SECTORS
        place = (
            math.floor(x / self._width_m),
            math.floor(y / self._width_m),
            math.floor(height_m / _LAYER_M),
            sector,
        )
        seen = self._keys.get(place, 0)
        if seen >= _ENOUGH and travelled_m % max(_APART_M, 2.0 * self._run_m) > self._run_m:
            return False
        self._keys[place] = min(seen + 1, _ENOUGH)
        return True


class Nearby:
    """Rows of positions (N, 2) in squares of `cell_m`: those within that distance are found without a look at all."""

    def __init__(self, positions_m: FloatArray, cell_m: float) -> None:
        self._squares = np.floor(positions_m / cell_m).astype(np.int64).tolist()
        self._rows: dict[tuple[int, int], array[int]] = {}
        self._added = 0

    def add_until(self, end: int) -> None:
        """Take in the rows before `end` that are not yet in."""
        for row in range(self._added, end):
            x, y = self._squares[row]
            self._rows.setdefault((x, y), array("q")).append(row)
        self._added = max(self._added, end)

    def around(self, row: int) -> npt.NDArray[np.int64]:
        """Return the rows taken in that may be within `cell_m` of a row's position, shape (K,), rising."""
        x, y = self._squares[row]
        squares = [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        found = [np.array(self._rows[square], np.int64) for square in squares if square in self._rows]
        return np.sort(np.concatenate([np.zeros(0, np.int64), *found]))
