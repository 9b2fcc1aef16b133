"""The path between waypoints: smoothed, by arc length, with heading and curvature; and where a point is beside it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray

STEP_M = 0.1
_KNOT_M = 0.25
_ROUNDS = 3


class Path(NamedTuple):
    """A path along the heading of the machine: x, y, heading (unwrapped), curvature in `points` (N, 4), each 0.1 m.

    `begin_m`, `end_m`: where its first and last waypoint are; before and after, it goes on straight.
    """

    points: FloatArray
    begin_m: float
    end_m: float

    @property
    def length_m(self) -> float:
        """Length with both extensions."""
        return (len(self.points) - 1) * STEP_M


def path_of(waypoints: FloatArray, smoothing_m: float, beyond_m: float) -> Path:
    """Return the path through waypoints (N, 2), in the direction of the heading, extended by so much at both ends.

    What is small against `smoothing_m` goes: the third derivative over the length is held against the waypoints, so that
    arcs stay. Noise of 2 cm on waypoints each 0.1 m makes the curvature of three neighbours a coin toss (errata).

    Raises:
        InputError: fewer than three different waypoints, or a value that is not finite.
    """
    line = _different(waypoints)
    for _ in range(_ROUNDS if smoothing_m > 0.0 else 1):
        line = _smoothed(line, waypoints if smoothing_m > 0.0 else line, smoothing_m)
    body = _even(line)
    first, last = body[0], body[-1]
    count = math.ceil(beyond_m / STEP_M)
    back: FloatArray = np.arange(count, 0, -1, dtype=np.float64)[:, None] * -STEP_M
    on: FloatArray = np.arange(1, count + 1, dtype=np.float64)[:, None] * STEP_M
    whole = np.concatenate([_ahead(first, back), body, _ahead(last, on)])
    return Path(np.ascontiguousarray(whole), count * STEP_M, (count + len(body) - 1) * STEP_M)


def _different(waypoints: FloatArray) -> FloatArray:
    if waypoints.ndim != 2 or waypoints.shape[1] not in (2, 3) or not np.isfinite(waypoints).all():
        raise InputError("a path is waypoints of finite x and y (and heading), shape (N, 2) or (N, 3)")
    line = np.asarray(waypoints, dtype=np.float64)[:, :2]
    keep = np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-6)
    if keep.sum() < 3:
        raise InputError(f"a path has at least three different waypoints, this one {keep.sum()}")
    return line[keep]


def _lengths(line: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def _smoothed(line: FloatArray, waypoints: FloatArray, smoothing_m: float) -> FloatArray:
    """Return points each quarter of a metre or so whose cubic interpolation is near the waypoints, placed by `line`."""
    targets = np.asarray(waypoints, dtype=np.float64)[:, :2]
    along = _lengths(line) if len(line) == len(targets) else _placed(targets, line)
    order = np.argsort(along, kind="stable")
    along, targets = along[order], targets[order]
    length = float(along[-1] - along[0])
    count = max(math.ceil(length / _KNOT_M) + 1, 8)
    at = (along - along[0]) / length * (count - 1)
    step = length / (count - 1)
    weight = (
        np.gradient(along) if len(along) > 1 else np.ones(1)
    )  # uneven waypoints: each stands for its part of the path
    weight = np.clip(weight, 0.05 * step, None)
    matrix = np.zeros((4, count))  # lower band
    right = np.zeros((count, 2))
    low = np.minimum(at.astype(int), count - 2)
    share = at - low
    for first, second, offset in ((1 - share, 1 - share, 0), (share, share, 0), (1 - share, share, 1)):
        rows = low + (1 if first is share else 0)
        np.add.at(matrix[offset], low if offset else rows, weight * first * second)
    np.add.at(right, low, (weight * (1 - share))[:, None] * targets)
    np.add.at(right, low + 1, (weight * share)[:, None] * targets)
    stiff = max(smoothing_m, 0.5 * step) ** 6 / step**5
    third = np.array([-1.0, 3.0, -3.0, 1.0])
    for k in range(4):
        for j in range(k, 4):
            matrix[j - k, k : count - 3 + k] += stiff * third[k] * third[j]
    found: FloatArray = solveh_banded(matrix, right, lower=True)
    return found


def _placed(points: FloatArray, line: FloatArray) -> FloatArray:
    """Return how far along a line (M, 2) each of points (N, 2) in its order is."""
    lengths, out, k = _lengths(line), np.empty(len(points)), 0
    for n, point in enumerate(points):
        ahead = line[k : k + 400]
        k += int(((ahead - point) ** 2).sum(axis=1).argmin())
        k = min(k, len(line) - 2)
        tangent = line[k + 1] - line[k]
        out[n] = lengths[k] + (point - line[k]) @ tangent / math.hypot(*tangent)
    return out


def _even(line: FloatArray) -> FloatArray:
    """Return x, y, heading, curvature (N, 4) each 0.1 m of the line's cubic spline."""
    lengths = _lengths(line)
    for _ in range(2):  # chords are shorter than the curve
        curve = CubicSpline(lengths, line)
        fine = np.linspace(0.0, lengths[-1], 8 * len(line))
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve(fine), axis=0).T))])
        lengths = np.interp(lengths, fine, way)
    curve = CubicSpline(lengths, line)
    s = np.arange(0.0, lengths[-1] + 1e-9, STEP_M)
    place, first, second = curve(s), curve(s, 1), curve(s, 2)
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / np.hypot(*first.T) ** 3
    return np.column_stack([place, np.unwrap(np.arctan2(first[:, 1], first[:, 0])), curvature])


def _ahead(row: FloatArray, way: FloatArray) -> FloatArray:
    """Return rows straight on from a row by ways (K, 1)."""
    ones = np.ones(len(way))
    place = row[:2] + way * np.array([math.cos(row[2]), math.sin(row[2])])
    return np.column_stack([place, row[2] * ones, 0.0 * ones])


@nb.njit(cache=True, nogil=True)
def beside(
    points: FloatArray, x: float, y: float, near: float, back: float, ahead: float
) -> tuple[float, float, float, float]:
    """Return the projection of a place on a path: length along (m), offset z (m, positive left), heading, curvature there.

    Looked for from `near - back` to `near + ahead` m; `points` as in `Path`.
    """
    first = min(max(int((near - back) / STEP_M), 0), len(points) - 2)
    last = min(max(int((near + ahead) / STEP_M) + 1, first + 1), len(points) - 1)
    best, least = first, 1e300
    for k in range(first, last + 1):
        far = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2
        if far < least:
            least, best = far, k
    heading, curvature = points[best, 2], points[best, 3]
    c, s = math.cos(heading), math.sin(heading)
    along = c * (x - points[best, 0]) + s * (y - points[best, 1])
    aside = -s * (x - points[best, 0]) + c * (y - points[best, 1])
    along /= max(1.0 - curvature * aside, 0.1)
    on = min(max(best + along / STEP_M, 0.0), len(points) - 1.0)
    k = min(int(on), len(points) - 2)
    share = on - k
    curvature = points[k, 3] + share * (points[k + 1, 3] - points[k, 3])
    return best * STEP_M + along, aside - 0.5 * curvature * along * along, heading + curvature * along, curvature


def nearest(points: FloatArray, x: float, y: float, heading: float) -> float:
    """Return how far along a path (m) the nearest place with about this heading is."""
    turned = np.abs((points[:, 2] - heading + math.pi) % (2.0 * math.pi) - math.pi)
    far = np.hypot(points[:, 0] - x, points[:, 1] - y) + 3.0 * turned
    return float(far.argmin() * STEP_M)
