"""Centre lines from a plan's polylines: corners become arcs, changes of grade become gradual."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import STEP_M, CentreLine, along_arc

_GRADE_OVER_M = 6.0  # a change of grade is spread over this way
_SHARE = 0.48  # of a straight piece that the arc at one of its ends may take
_SHARPEST_RAD = math.radians(150.0)
_LEAST_M = 0.05


class _Piece(NamedTuple):
    """A straight (curvature 0) or an arc: where it begins, its heading there, curvature (1/m) and length (m)."""

    x_m: float
    y_m: float
    heading_rad: float
    curvature_pm: float
    length_m: float

    def at(self, way_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x, y, heading after a way (N,) on it."""
        return along_arc((self.x_m, self.y_m), self.heading_rad, self.curvature_pm, way_m)


def rounded_line(points_m: FloatArray, bend_radius_m: float, name: str) -> CentreLine:
    """Return the line through points (N, 3) whose corners are rounded, with less than the radius where they are close.

    Raises:
        ConfigError: points coincide in plan, or a corner is sharper than 150 degrees.
    """
    pieces, knots_m = _pieces(points_m, bend_radius_m, name)
    ends = np.cumsum([piece.length_m for piece in pieces])
    s = np.append(np.arange(0.0, ends[-1] - 0.5 * STEP_M, STEP_M), ends[-1])
    index = np.minimum(np.searchsorted(ends, s, side="right"), len(pieces) - 1)
    columns = np.empty((4, len(s)))
    for k, piece in enumerate(pieces):
        on = index == k
        columns[:3, on] = piece.at(s[on] - (ends[k] - piece.length_m))
        columns[3, on] = piece.curvature_pm
    return CentreLine(s, columns[0], columns[1], _heights(s, knots_m, points_m[:, 2]), columns[2], columns[3])


def _pieces(points_m: FloatArray, radius_m: float, name: str) -> tuple[list[_Piece], FloatArray]:
    """Return straights and arcs, and where on them the points lie (of a corner the middle of its arc), (N,)."""
    legs = np.diff(points_m[:, :2], axis=0)
    lengths = np.hypot(*legs.T)
    if (lengths < _LEAST_M).any():
        k = int(np.argmin(lengths))
        raise ConfigError(f"line_m of '{name}': points {k + 1} and {k + 2} are the same place in plan")
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    turns = (np.diff(headings) + math.pi) % (2 * math.pi) - math.pi
    if (np.abs(turns) > _SHARPEST_RAD).any():
        k = int(np.argmax(np.abs(turns)))
        raise ConfigError(
            f"line_m of '{name}': it turns by {math.degrees(turns[k]):.0f}° at point {k + 2}; 150° at most were wanted"
        )
    tangents = np.zeros(len(points_m))
    tangents[1:-1] = np.minimum(radius_m * np.tan(0.5 * np.abs(turns)), _SHARE * np.minimum(lengths[:-1], lengths[1:]))
    pieces, knots, way = [], [0.0], 0.0
    for k, (length, heading) in enumerate(zip(lengths, headings, strict=True)):
        straight = float(length - tangents[k] - tangents[k + 1])
        x, y = points_m[k, :2] + tangents[k] * legs[k] / length
        pieces.append(_Piece(float(x), float(y), float(heading), 0.0, straight))
        way += straight
        if k < len(turns) and tangents[k + 1] > 0.0:
            turn = float(turns[k])
            arc = abs(turn) * float(tangents[k + 1]) / math.tan(0.5 * abs(turn))
            corner = points_m[k + 1, :2] - tangents[k + 1] * legs[k] / length
            pieces.append(_Piece(float(corner[0]), float(corner[1]), float(heading), turn / arc, arc))
            knots.append(way + 0.5 * arc)
            way += arc
        else:
            knots.append(way)
    return [piece for piece in pieces if piece.length_m > 0.0], np.array(knots)


def _heights(s_m: FloatArray, knots_m: FloatArray, z_m: FloatArray) -> FloatArray:
    """Return the height at each sample, shape (N,): linear from point to point, the grade's changes spread; the ends stay."""
    z = np.interp(s_m, knots_m, z_m)
    half = min(round(0.5 * _GRADE_OVER_M / STEP_M), (len(z) - 1) // 2)
    if half == 0:
        return z
    before = 2.0 * z[0] - z[half:0:-1]
    after = 2.0 * z[-1] - z[-2 : -half - 2 : -1]
    total = np.cumsum(np.concatenate([[0.0], before, z, after]))
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def on_line(line: CentreLine, points_m: FloatArray, *, height_weight: float = 1.0) -> FloatArray:
    """Return the arc lengths (N,) of the line's samples that are nearest to points (N, 3), in space."""
    from scipy.spatial import KDTree

    every = max(round(0.05 / STEP_M), 1)
    picked = np.unique(np.append(np.arange(0, len(line.s_m), every), len(line.s_m) - 1))
    tree = KDTree(np.stack([line.x_m, line.y_m, height_weight * line.z_m], axis=1)[picked])
    scaled = np.atleast_2d(points_m) * np.array([1.0, 1.0, height_weight])
    return line.s_m[picked[tree.query(scaled)[1]]]
