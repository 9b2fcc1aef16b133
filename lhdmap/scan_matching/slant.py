"""Where on a rough wall a tilted scanner finds again what it saw before: not straight above it.

A scan is a line on the wall. As the machine drives on, the lines lie higher and higher, and rock is the more alike the nearer:
what a hit is like lies at a right angle to the line that the map has. Where the lines rise by m along the wall, a hit that lies
h above such a line is like the rock m h / (1 + m²) further along it. Taken for the rock straight below, it holds the machine
back, a millimetre or two in each match and a quarter of a per cent of the way.

The rise is that over the machine's own floor, the scanner's tilt: walls are alike along the drift, not along the horizon.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

NO_RISE = np.zeros(2)
_REACH_M = 0.7  # the wall's course is that of the hits so far to both sides: longer than rock, shorter than a bend
_LONGEST = 6.0  # times that: beyond it the hits around are not of one wall


def rise_of(T_base_sensor: FloatArray) -> FloatArray:
    """Return how the plane of a scanner rises over the machine's floor, shape (2,): dz/dx and dz/dy; `T_base_sensor` (4, 4)."""
    normal = T_base_sensor[:3, 2]
    return np.array([-normal[0] / normal[2], -normal[1] / normal[2]])


@nb.njit(cache=True, nogil=True)
def slants(points: FloatArray, rise: FloatArray) -> FloatArray:
    """Return for hits (N, 3) in the order of the beams how far along the wall that lies which they are like.

    Shape (N, 2), in metres for each metre that a hit lies above the map's hits; `rise` (2,): of the plane that these were seen
    in. Both in the level base frame.
    """
    count, reach2 = points.shape[0], _REACH_M**2
    out = np.zeros((count, 2))
    before = after = 0
    for i in range(count):
        x, y = points[i, 0], points[i, 1]
        while before + 1 < i and (points[before + 1, 0] - x) ** 2 + (points[before + 1, 1] - y) ** 2 >= reach2:
            before += 1
        after = max(after, i)
        while after < count - 1 and (points[after, 0] - x) ** 2 + (points[after, 1] - y) ** 2 < reach2:
            after += 1
        tx, ty = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
        length2 = tx * tx + ty * ty
        if 0.0 < length2 < _LONGEST**2 * reach2:
            climb = rise[0] * tx + rise[1] * ty
            share = climb / (length2 + climb * climb)
            out[i, 0], out[i, 1] = share * tx, share * ty
    return out
