"""Lines with fewer points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray


def thinned(line_m: FloatArray, tolerance_m: float) -> npt.NDArray[np.int64]:
    """Return which points of a line (N, 2 or 3) keep it within a tolerance (m), ends included.

    Douglas and Peucker, "Algorithms for the reduction of the number of points required to represent a digitized line", 1973:
    the farthest point from the chord stays, and both halves are looked at again.
    """
    line = np.asarray(line_m, dtype=float)
    keep = np.zeros(len(line), dtype=bool)
    keep[[0, -1]] = True
    open_ends = [(0, len(line) - 1)]
    while open_ends:
        first, last = open_ends.pop()
        if last - first < 2:
            continue
        away = _from_chord(line[first + 1 : last], line[first], line[last])
        worst = int(np.argmax(away))
        if away[worst] > tolerance_m:
            middle = first + 1 + worst
            keep[middle] = True
            open_ends += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)


def _from_chord(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the distance of points (N, 2 or 3) from the stretch between two; a line that comes back to its start has none."""
    chord = end - start
    squared = float(chord @ chord)
    share = np.clip((points - start) @ chord / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(points))
    distances: FloatArray = np.linalg.norm(points - start - share[:, None] * chord, axis=1)
    return distances
