"""The hits that the pile is looked for in: those of the last stretch of the drive, thinned, in a ring of fixed size."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

_ROOM = 120_000  # hits: 45 m at a scan each 0.1 m
_APART_M = 0.05  # hits of one scan nearer to each other than this are one
_STEP_M = 0.06
_BEHIND_M, _BESIDE_M = 1.0, 12.0


class HitWindow:
    """Hits in the map with the place of the machine, along its path, from where they were seen.

    `hits()` gives rows x, y, z (m), travelled (m). Memory and cost do not grow with the drive.
    """

    def __init__(self, reach_m: float) -> None:
        self._reach_m = reach_m
        self._rows = np.full((_ROOM, 4), np.nan)
        self._out = np.empty_like(self._rows)
        self._next = 0
        self._last_m = -np.inf

    def add(self, points_map: FloatArray, position_map: FloatArray, travelled_m: float) -> None:
        """Take one scan's hits, shape (N, 3), in the order of the beams, unless the machine has hardly moved since the last."""
        if abs(travelled_m - self._last_m) < _STEP_M:
            return
        self._last_m = travelled_m
        self._next = _append(self._rows, self._next, points_map, position_map, (travelled_m, self._reach_m, _APART_M))

    def hits(self, pose: FloatArray, travelled_m: float) -> FloatArray:
        """Return the hits around and ahead of a pose: rows x, y, z in its frame (m), travelled (m), shape (N, 4).

        `pose`: x, y, z (m), heading (rad), shape (4,); only hits of the last `reach_m` of travel. The rows are a view of memory
        that the next call writes anew.
        """
        return self._out[: _around(self._rows, pose, (travelled_m, self._reach_m), self._out)]


@nb.njit(cache=True, nogil=True)
def _append(rows, at, points, position, limits):  # type: ignore[no-untyped-def]
    """Write the thinned hits at `at`, round and round; return the next place."""
    travelled, reach, apart = limits
    last_x, last_y = np.inf, np.inf
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        far = (x - position[0]) ** 2 + (y - position[1]) ** 2 > reach * reach
        if far or not math.isfinite(x + y + points[i, 2]) or (x - last_x) ** 2 + (y - last_y) ** 2 < apart * apart:
            continue
        rows[at, 0], rows[at, 1], rows[at, 2], rows[at, 3] = x, y, points[i, 2], travelled
        last_x, last_y = x, y
        at = (at + 1) % rows.shape[0]
    return at


@nb.njit(cache=True, nogil=True)
def _around(rows, pose, limits, out):  # type: ignore[no-untyped-def]
    """Fill `out` with what lies ahead, in the frame of the pose; return how many."""
    c, s = np.cos(pose[3]), np.sin(pose[3])
    count = 0
    for i in range(rows.shape[0]):
        if not abs(rows[i, 3] - limits[0]) < limits[1]:
            continue
        dx, dy = rows[i, 0] - pose[0], rows[i, 1] - pose[1]
        x, y = c * dx + s * dy, -s * dx + c * dy
        if x < -_BEHIND_M or abs(y) > _BESIDE_M:
            continue
        out[count, 0], out[count, 1], out[count, 2], out[count, 3] = x, y, rows[i, 2] - pose[2], rows[i, 3]
        count += 1
    return count
