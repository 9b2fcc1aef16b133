"""The walls beside the way into the pile, as lines: a drift goes on as straight behind the toe as before it, unseen.

A pile that has been dug lies askew in its drift, and its face looks to one side. In a drift the way in is along the walls.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

_BACK_M, _AHEAD_M, _BEFORE_M = 4.0, 14.0, 0.5  # of base_link, and before the pile: hits between are a wall's
_NEAREST_M, _FARTHEST_M = 0.8, 4.0  # to a side
_FEWEST, _SPAN_M, _MOST_STD_M = 15, 2.5, 0.35
_ROUNDS = 5
_STEEPEST, _PARALLEL = math.tan(math.radians(20.0)), math.tan(math.radians(6.0))
_ON_M, _STEP_M = 1.5, 0.1  # a line begins so far before the pile
_MOST_SKEW = math.tan(math.radians(20.0))
_ROUGH = 1.5  # standard deviations that rock may stand before the line


class WallLine(NamedTuple):
    """y = `at_m` + `slope` x in `base_link`; `std_m` of the hits about it."""

    at_m: float
    slope: float
    std_m: float


WallLines = tuple[WallLine | None, WallLine | None]
"""To the right and to the left of the machine."""


def wall_lines(walls_m: FloatArray, limits_m: FloatArray) -> WallLines:
    """Return the walls to the right and to the left of the machine, of hits (N, 2) and the pile's limits (2, 2) in `base_link`.

    None: too few hits, not straight, or not along the machine's way.
    """
    x, y = walls_m[:, 0], walls_m[:, 1]
    beside = (x > -_BACK_M) & (x < min(float(limits_m[:, 0].min()) - _BEFORE_M, _AHEAD_M))
    near = beside & (np.abs(y) > _NEAREST_M) & (np.abs(y) < _FARTHEST_M)
    return _line(walls_m[near & (y < 0.0)]), _line(walls_m[near & (y > 0.0)])


def axis_rad(lines: WallLines) -> float | None:
    """Return the direction of a drift with both walls, in `base_link`; None where there are not two that are parallel."""
    right, left = lines
    if right is None or left is None or abs(right.slope - left.slope) > _PARALLEL:
        return None
    return math.atan(0.5 * (right.slope + left.slope))


def from_wall_to_wall(limits_m: FloatArray, lines: WallLines) -> FloatArray:
    """Return a pile's limits (2, 2) E_R, E_L in `base_link` drawn along their own line to both walls of its drift.

    Of a pile that has been dug a bank is seen at times, and what lies deeper beside it is not: its middle is no place to dig at.
    Limits that lie along the drift rather than across it are taken across.
    """
    axis = axis_rad(lines)
    right, left = lines
    if axis is None or right is None or left is None:
        return limits_m
    along, across = np.array([math.cos(axis), math.sin(axis)]), np.array([-math.sin(axis), math.cos(axis)])
    middle, E = limits_m.mean(axis=0), limits_m[1] - limits_m[0]
    skew = float(np.clip(float(E @ along) / max(float(E @ across), 1e-9), -_MOST_SKEW, _MOST_SKEW))
    on = across + skew * along
    ends = []
    for line, inward in ((right, 1.0), (left, -1.0)):
        at_m = line.at_m + inward * _ROUGH * line.std_m
        far = (at_m + line.slope * middle[0] - middle[1]) / (on[1] - line.slope * on[0])
        ends.append(middle + far * on)
    return np.stack(ends)


def walls_beyond(lines: WallLines, limits_m: FloatArray, way_m: float) -> FloatArray:
    """Return points (N, 2) of the walls beside the pile, from before its limits (2, 2) to `way_m` behind them.

    They stand before the line by what rock does: the scanner has seen it at one height.
    """
    begin, end = float(limits_m[:, 0].min()) - _ON_M, float(limits_m[:, 0].max()) + way_m
    x = np.arange(begin, end, _STEP_M)
    parts = [np.zeros((0, 2))]
    for line, inward in zip(lines, (1.0, -1.0), strict=True):
        if line is not None:
            parts.append(np.column_stack([x, line.at_m + line.slope * x + inward * _ROUGH * line.std_m]))
    return np.concatenate(parts)


def _line(hits_m: FloatArray) -> WallLine | None:
    """Return the line through hits (N, 2), those that stand off left out (Tukey's weights)."""
    if len(hits_m) < _FEWEST or float(np.ptp(hits_m[:, 0])) < _SPAN_M:
        return None
    x, y = hits_m.T
    weights, at, slope, scale = np.ones(len(x)), 0.0, 0.0, math.inf
    for _ in range(_ROUNDS):
        middle = np.average(hits_m, axis=0, weights=weights)
        dx, dy = x - middle[0], y - middle[1]
        slope = float((weights * dx * dy).sum() / max((weights * dx * dx).sum(), 1e-9))
        at = float(middle[1] - slope * middle[0])
        off = y - at - slope * x
        scale = max(1.5 * float(np.median(np.abs(off))), 0.02)
        weights = np.maximum(1.0 - (off / (4.0 * scale)) ** 2, 0.0) ** 2
    if scale > _MOST_STD_M or abs(slope) > _STEEPEST:
        return None
    return WallLine(at, slope, scale)
