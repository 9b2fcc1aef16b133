"""The centre line of a drift: straight and arc pieces with grade, and paths beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

STEP_M = 0.01
Pieces = tuple[tuple[float, float, float], ...]


class CentreLine(NamedTuple):
    """A line sampled each `STEP_M` of horizontal arc length; all shapes (N,): metres, radians, 1/m."""

    s_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray
    curvature_pm: FloatArray

    @property
    def length_m(self) -> float:
        """Horizontal length, metres."""
        return float(self.s_m[-1])

    def at(self, s_m: FloatArray) -> FloatArray:
        """Return x, y, z, heading, shape (N, 4), at arc lengths within the line."""
        columns = (self.x_m, self.y_m, self.z_m, self.heading_rad)
        return np.stack([np.interp(s_m, self.s_m, column) for column in columns], axis=-1)


class Start(NamedTuple):
    """Where a line begins: position (m) and heading (rad) in the map."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float


def centre_line(pieces: Pieces, length_m: float, transition_m: float, start: Start) -> CentreLine:
    """Return the line of `length_m` through `pieces` (length m, radius m, grade %), repeated as often as is needed.

    Curvature and grade change linearly over `transition_m`; the total turn of a bend stays what its piece says.
    """
    s = np.arange(round(length_m / STEP_M) + 1, dtype=float) * STEP_M
    ends = np.cumsum([piece[0] for piece in pieces])
    index = np.minimum(np.searchsorted(ends, s % ends[-1], side="right"), len(pieces) - 1)
    curvature = np.array([1.0 / radius if radius else 0.0 for _, radius, _ in pieces])[index]
    grade = np.array([grade / 100.0 for _, _, grade in pieces])[index]
    curvature, grade = _smoothed(curvature, transition_m), _smoothed(grade, transition_m)
    heading = start.heading_rad + _integral(curvature)
    x, y = start.x_m + _integral(np.cos(heading)), start.y_m + _integral(np.sin(heading))
    return CentreLine(s, x, y, start.z_m + _integral(grade), heading, curvature)


def along_arc(
    origin_m: tuple[float, float], heading_rad: float, curvature_pm: float, way_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, y, heading, each (N,), after a way on an arc (curvature 0: a straight) from a point and heading."""
    half = 0.5 * curvature_pm * way_m
    chord = way_m * np.sinc(half / np.pi)
    middle = heading_rad + half
    return origin_m[0] + chord * np.cos(middle), origin_m[1] + chord * np.sin(middle), middle + half


def beside(line: CentreLine, offset_m: FloatArray) -> CentreLine:
    """Return the path `offset_m`, shape (N,), to the left of the line, sampled by its own arc length.

    The offset must be smooth: the heading follows from its slope, so that the path is free of side slip.
    """
    slope, stretch = np.gradient(offset_m, STEP_M), 1.0 - line.curvature_pm * offset_m
    own = _integral(np.hypot(slope, stretch))
    heading = line.heading_rad + np.arctan2(slope, stretch)
    x = line.x_m - offset_m * np.sin(line.heading_rad)
    y = line.y_m + offset_m * np.cos(line.heading_rad)
    s = np.arange(int(own[-1] / STEP_M) + 1, dtype=float) * STEP_M
    x, y, z, heading = (np.interp(s, own, column) for column in (x, y, line.z_m, heading))
    return CentreLine(s, x, y, z, heading, np.gradient(heading, STEP_M))


def _smoothed(values: FloatArray, width_m: float) -> FloatArray:
    """Return the moving mean over `width_m`; the ends go on as they are."""
    half = round(0.5 * width_m / STEP_M)
    if half == 0:
        return values
    padded = np.concatenate([np.full(half + 1, values[0]), values, np.full(half, values[-1])])
    total = np.cumsum(padded)
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def _integral(values: FloatArray) -> FloatArray:
    """Return the integral from the start by the trapezoid rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * STEP_M * (values[1:] + values[:-1]))])
