"""The end of the drift as a frame: x along the last metres of its walls, y to the left, z up; and the floor before the toe."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.pile.corridor import BIN_M, DriftCorridor
from lhdmap.pile.order import quantile

_WALLS_M = 7.0  # length of wall before the face that its heading is taken from
_FEWEST_BINS = 4
_MOST_TURN = 0.35
_STOPE_M = 0.35  # a wall at the face stands so much farther out than before: a stope's, the drift ends at its mouth
_BEFORE_M = (4.5, 11.5)  # where the drift before a stope is looked for
_NEAREST_BINS = 8
_FLOOR_HITS = 12
_AWAY_M = 1.4  # from the toe
_ROCK_M = 0.5  # above the path: its grade goes on for up to 25 m, and may change


@nb.njit(cache=True, nogil=True)
def turned_near(points, at, turn_rad, near_m):  # type: ignore[no-untyped-def]
    """Return the hits (N, 4) less than `near_m` along x from a point `at` (2,), in the frame that begins there, turned left."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    out = np.empty_like(points)
    used = 0
    for i in range(points.shape[0]):
        x, y = points[i, 0] - at[0], points[i, 1] - at[1]
        if abs(x) < near_m:
            out[used, 0], out[used, 1] = c * x + s * y, c * y - s * x
            out[used, 2], out[used, 3] = points[i, 2], points[i, 3]
            used += 1
    return out[:used]


class End(NamedTuple):
    """The drift's end: how far it turns left of the frame's x axis (rad), y of its middle at the face and half its width (m)."""

    turn_rad: float
    middle_m: float
    half_m: float


def _mouth(corridor: DriftCorridor, at_x_m: float, slope: float) -> tuple[float, float] | None:
    """Return y of both walls of the drift some metres before x, carried on along the end's slope; None: hardly seen.

    A drift runs at any angle to the machine and bends: its width is what can be carried over, its walls' y is not.
    """
    before = (corridor.x_m < at_x_m - _BEFORE_M[0]) & (corridor.x_m > at_x_m - _BEFORE_M[1])
    before &= np.isfinite(corridor.left_m) & np.isfinite(corridor.right_m)
    if before.sum() < _FEWEST_BINS:
        return None
    left, right, x = corridor.left_m[before], corridor.right_m[before], corridor.x_m[before]
    half = 0.5 * float(np.median(left - right))
    middle = float(np.median((0.5 * (left + right) + slope * (at_x_m - x))[-_NEAREST_BINS:]))
    return middle + half, middle - half


def end_of(corridor: DriftCorridor, face_x_m: float) -> End | None:
    """Return the end before a face at x, from the walls of the last metres; None where they were not seen."""
    last = (corridor.x_m < face_x_m - 0.8) & (corridor.x_m > face_x_m - _WALLS_M)
    lines, weights = [], []
    for wall in (corridor.left_m, corridor.right_m):
        seen = last & np.isfinite(wall)
        if seen.sum() >= _FEWEST_BINS:
            lines.append(_line(corridor.x_m[seen], wall[seen]))
            weights.append(float(seen.sum()))
    if not lines:
        return None
    slope = float(np.clip(np.average([line[0] for line in lines], weights=weights), -_MOST_TURN, _MOST_TURN))
    at = np.array([face_x_m])
    middle, half = float(corridor.centre_at(at)[0]), float(corridor.half_at(at)[0])
    if len(lines) == 2:
        last_x_m = face_x_m - 0.5
        left, right = (offset + own * last_x_m for own, offset in lines)
        mouth = _mouth(corridor, last_x_m, slope)
        if mouth is not None and left - right > mouth[0] - mouth[1] + 2.0 * _STOPE_M:
            left, right = mouth
        middle, half = 0.5 * (left + right), 0.5 * (left - right)
    return End(math.atan(slope), middle, half)


@nb.njit(cache=True, nogil=True)
def _line(x, y):  # type: ignore[no-untyped-def]
    """Return slope and offset by Theil and Sen: the median of the slopes of all pairs that are metres apart."""
    slopes, count = np.empty(x.size * x.size), 0
    for i in range(x.size):
        for j in range(i + 1, x.size):
            if x[j] - x[i] > 2.0 * BIN_M:
                slopes[count] = (y[j] - y[i]) / (x[j] - x[i])
                count += 1
    slope = quantile(slopes, count, 0.5) if count else 0.0
    offsets = np.empty(x.size)
    for i in range(x.size):
        offsets[i] = y[i] - slope * x[i]
    return slope, quantile(offsets, x.size, 0.5)


@nb.njit(cache=True, nogil=True)
def floor_before(points, toe_x_m, half_m, path_z_m):  # type: ignore[no-untyped-def]
    """Return z of the floor in the metres before a toe, from hits (N, 3+) in the end frame; NaN where it was not seen.

    Rocks of the face lie before its toe as well, but not farther away, and higher than where the machine's path would lead.
    """
    x, z = np.empty(points.shape[0]), np.empty(points.shape[0])
    before = 0
    for i in range(points.shape[0]):
        along = points[i, 0] - toe_x_m
        if along > -5.0 and along < -0.4 and abs(points[i, 1]) < half_m - 0.6:
            x[before], z[before] = along, points[i, 2]
            before += 1
    if before < _FLOOR_HITS:
        return math.nan
    high = quantile(z[:before].copy(), before, 0.2) + 0.25
    flat, away = 0, 0
    for i in range(before):
        if z[i] < high:
            z[flat] = z[i]
            flat += 1
            away += x[i] < -_AWAY_M
    if flat < _FLOOR_HITS:
        return math.nan
    floor = quantile(z, flat, 0.5)
    return floor if away >= _FLOOR_HITS or floor < path_z_m + _ROCK_M else math.nan
