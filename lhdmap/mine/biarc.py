"""Two arcs from one pose to another without a kink: the way of a machine from one drift into the next."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import STEP_M, CentreLine, along_arc

_DETOUR = 6.0  # times the distance


def biarc(start: FloatArray, end: FloatArray) -> CentreLine:
    """Return the line from pose `start` to `end`, each x, y, z, heading, shape (4,): two arcs of equal tangent lengths.

    Where one arc fits both poses, both are parts of it. Heights go over without a step in grade where both ends are level.

    Raises:
        ValueError: the poses are the same place, or only loops lead from one to the other, as where `end` lies behind `start`.
    """
    a, b = start[:2], end[:2]
    t_a, t_b = (np.array([math.cos(pose[3]), math.sin(pose[3])]) for pose in (start, end))
    d = _tangent_length(b - a, t_a, t_b)
    middle = 0.5 * (a + b + d * (t_a - t_b))
    lines = [_arc(a, start[3], middle), _arc(middle, None, b)]
    first_end = lines[0][2]
    lines[1] = _arc(middle, first_end, b)
    lengths = [abs(turn / curvature) if curvature else length for length, curvature, _, turn in lines]
    total = sum(lengths)
    if total > _DETOUR * float(np.hypot(*(b - a))):
        raise ValueError("the way would be a detour of loops")
    s = np.append(np.arange(0.0, total - 0.5 * STEP_M, STEP_M), total)
    on_second = s > lengths[0]
    x, y, heading, curvature_pm = (np.empty_like(s) for _ in range(4))
    for on, origin, h0, k, way in (
        (~on_second, a, start[3], lines[0][1], s),
        (on_second, middle, first_end, lines[1][1], s - lengths[0]),
    ):
        place = (float(origin[0]), float(origin[1]))
        x[on], y[on], heading[on] = along_arc(place, h0, k, way[on])
        curvature_pm[on] = k
    share = s / total
    z = start[2] + (end[2] - start[2]) * share * share * (3.0 - 2.0 * share)
    return CentreLine(s, x, y, z, heading, curvature_pm)


def _tangent_length(v: FloatArray, t_a: FloatArray, t_b: FloatArray) -> float:
    """Return the length of the tangents at both ends for which the arcs meet without a kink."""
    both = t_a + t_b
    flat, across = 2.0 * (1.0 - float(t_a @ t_b)), float(v @ both)
    square = float(v @ v)
    if square < 1e-12:
        raise ValueError("both ends are the same place")
    if abs(flat) < 1e-9:
        along = float(v @ t_b)
        if along <= 0.0:
            raise ValueError("the end lies behind the start")
        return square / (4.0 * along)
    return (-across + math.sqrt(across * across + flat * square)) / flat


def _arc(origin: FloatArray, heading_rad: float | None, end: FloatArray) -> tuple[float, float, float, float]:
    """Return chord length, curvature (1/m), final heading and turn of the arc from a pose through a point."""
    chord = end - origin
    length = float(np.hypot(*chord))
    bearing = math.atan2(chord[1], chord[0])
    if heading_rad is None:
        return length, 0.0, bearing, 0.0
    half = (bearing - heading_rad + math.pi) % (2 * math.pi) - math.pi
    if abs(half) < 1e-9 or length < 1e-9:
        return length, 0.0, heading_rad, 0.0
    return length, 2.0 * math.sin(half) / length, heading_rad + 2.0 * half, 2.0 * half
