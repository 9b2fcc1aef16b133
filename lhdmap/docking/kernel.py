"""Ways of the machine with the joint as a state, and whether both bodies fit along them."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray


@nb.njit(cache=True, nogil=True)
def driven(
    start: FloatArray, moves: FloatArray, steps: FloatArray, change_pm: float, lengths: tuple[float, float]
) -> FloatArray:
    """Return states (N + 1, 5): x, y, heading of the rear axle, joint angle, signed way; from a start (4,).

    `moves` (K, 3): gear, joint angle that is steered to (rad), length (m); `steps` (K,): in how many steps each is done.
    The joint changes by `change_pm` (rad/m) until it is there: nothing turns where the machine stands.
    """
    front_m, rear_m = lengths
    count = 0
    for k in range(len(moves)):
        count += int(steps[k])
    out = np.zeros((count + 1, 5))
    x, y, heading, bend, way = start[0], start[1], start[2], start[3], 0.0
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = x, y, heading, bend
    n = 0
    for k in range(len(moves)):
        step = moves[k, 2] / steps[k]
        signed, most = moves[k, 0] * step, change_pm * abs(step)
        for _ in range(int(steps[k])):
            change = min(max(moves[k, 1] - bend, -most), most)
            middle = bend + 0.5 * change
            turn = (signed * math.sin(middle) - front_m * change) / (front_m + rear_m * math.cos(middle))
            x += signed * math.cos(heading + 0.5 * turn)
            y += signed * math.sin(heading + 0.5 * turn)
            heading, bend, way = heading + turn, bend + change, way + signed
            n += 1
            out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4] = x, y, heading, bend, way
    return out


@nb.njit(cache=True, nogil=True)
def inside(x: float, y: float, corners: FloatArray) -> bool:
    """Return whether a place is within a polygon (N, 2)."""
    within, before = False, len(corners) - 1
    for k in range(len(corners)):
        if (corners[k, 1] > y) != (corners[before, 1] > y):
            share = (y - corners[k, 1]) / (corners[before, 1] - corners[k, 1])
            if x < corners[k, 0] + share * (corners[before, 0] - corners[k, 0]):
                within = not within
        before = k
    return within


@nb.njit(cache=True, nogil=True)
def fits(
    states: FloatArray, every: int, outlines: tuple[FloatArray, FloatArray], corners: FloatArray, blocked: FloatArray,
    lengths: tuple[float, float],
) -> int:  # fmt: skip
    """Return the first of the states (each `every`-th, and the last) at which a body does not fit, or -1.

    `outlines`: points around the front and the rear body, margin included, first of each the box's low and high corner;
    `blocked` (M, 2): points that no body may cover. Bodies are within the polygon where their outlines are.
    """
    for n in range(len(states)):
        if n % every and n != len(states) - 1:
            continue
        x1, y1, back = states[n, 0], states[n, 1], states[n, 2]
        ahead = back + states[n, 3]
        x0 = x1 + lengths[1] * math.cos(back) + lengths[0] * math.cos(ahead)
        y0 = y1 + lengths[1] * math.sin(back) + lengths[0] * math.sin(ahead)
        for body in range(2):
            x, y, heading = (x0, y0, ahead) if body == 0 else (x1, y1, back)
            c, s = math.cos(heading), math.sin(heading)
            outline = outlines[body]
            for k in range(2, len(outline)):
                px, py = x + c * outline[k, 0] - s * outline[k, 1], y + s * outline[k, 0] + c * outline[k, 1]
                if not inside(px, py, corners):
                    return n
            for points in (corners, blocked):
                for k in range(len(points)):
                    dx, dy = points[k, 0] - x, points[k, 1] - y
                    px, py = c * dx + s * dy, -s * dx + c * dy
                    if outline[0, 0] < px < outline[1, 0] and outline[0, 1] < py < outline[1, 1]:
                        return n
    return -1
