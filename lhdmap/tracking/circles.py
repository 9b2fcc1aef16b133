"""Circular look-ahead (Section 2.4.3): a circle through three points of the path, and where an axle is beside it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray


class Beside(NamedTuple):
    """Offset z (m, positive left), heading of the path there (rad), curvature (1/m, positive left)."""

    offset_m: float
    heading_rad: float
    curvature_pm: float


def three_points(waypoints: FloatArray, x: float, y: float, least_m: float, near: int) -> tuple[FloatArray, int]:
    """Return three waypoints (3, 2) from the closest one on, at least so far apart, and which one is the closest.

    Looked for around `near`. At the end of the path the last three so far apart: the paper leaves that open.
    """
    low, high = max(near - 100, 0), min(near + 200, len(waypoints))
    closest = low + int(np.hypot(waypoints[low:high, 0] - x, waypoints[low:high, 1] - y).argmin())
    chosen = _onward(waypoints, closest, least_m, 1)
    if len(chosen) < 3:
        chosen = _onward(waypoints, len(waypoints) - 1, least_m, -1)[::-1]
    return waypoints[chosen[:3], :2], closest


def _onward(waypoints: FloatArray, first: int, least_m: float, by: int) -> list[int]:
    chosen, k = [first], first + by
    while 0 <= k < len(waypoints) and len(chosen) < 3:
        if math.dist(waypoints[k, :2], waypoints[chosen[-1], :2]) >= least_m:
            chosen.append(k)
        k += by
    return chosen


def circle_beside(three: FloatArray, x: float, y: float) -> Beside:
    """Return where a place is beside the circle through three points, which are in the path's direction.

    Points on a line are a line: the signed curvature (Menger) is 0 there, and no radius is needed.
    """
    a, b, c = three
    along = c - a
    twice = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    sides = math.dist(a, b) * math.dist(b, c) * math.dist(a, c)
    curvature = 2.0 * twice / sides if sides > 1e-12 else 0.0
    if abs(curvature) < 1e-6:
        heading = math.atan2(along[1], along[0])
        return Beside(float(-math.sin(heading) * (x - a[0]) + math.cos(heading) * (y - a[1])), heading, 0.0)
    # the middle is on the perpendicular of the chord a b, at the signed radius from both
    chord = b - a
    half = 0.5 * math.hypot(*chord)
    radius = 1.0 / curvature
    up = math.copysign(math.sqrt(max(radius**2 - half**2, 0.0)), radius)
    if (b - a) @ (c - b) < 0.0:
        up = -up
    normal = np.array([-chord[1], chord[0]]) / (2.0 * half)
    middle = 0.5 * (a + b) + up * normal
    dx, dy = x - middle[0], y - middle[1]
    side = math.copysign(1.0, radius)
    return Beside(side * (abs(radius) - math.hypot(dx, dy)), math.atan2(side * dx, -side * dy), curvature)
