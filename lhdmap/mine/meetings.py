"""Where the centre lines of a plan meet: drifts join where they cross or touch in space, and pass well above each other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from lhdmap.errors import ConfigError
from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import STEP_M, CentreLine
from lhdmap.mine.plan import DriftPlan
from lhdmap.mine.polyline import on_line, rounded_line

JOIN_M = 0.5
PASS_M = 3.0
_EVERY = 10  # samples of a line, 0.1 m
_APART_M = 8.0  # two meetings of the same lines are at least this far from each other
_NEAR_M = 0.15
_FLAT = 0.2


class Meeting(NamedTuple):
    """Two places on centre lines that are one place of the mine: index of the line, arc length (m), twice."""

    first: int
    first_m: float
    second: int
    second_m: float


def drift_lines(drifts: Sequence[DriftPlan]) -> list[CentreLine]:
    """Return the centre lines of drifts; an end that touches another drift's polyline lies on its (rounded) centre line.

    Raises:
        ConfigError: a line has coinciding points or too sharp a corner.
    """
    points = [np.array(drift.line_m, dtype=float) for drift in drifts]
    lines = [rounded_line(one, drift.bend_radius_m, drift.name) for one, drift in zip(points, drifts, strict=True)]
    for k, drift in enumerate(drifts):
        moved = points[k].copy()
        for end in (0, -1):
            for other, line in enumerate(lines):
                if other != k and _distance_to_polyline(points[k][end], points[other]) <= JOIN_M:
                    moved[end] = line.at(on_line(line, points[k][end]))[0, :3]
        if not np.array_equal(moved, points[k]):
            lines[k] = rounded_line(moved, drift.bend_radius_m, drift.name)
    return lines


def meetings(names: Sequence[str], lines: Sequence[CentreLine]) -> list[Meeting]:
    """Return where the lines join: where two cross or touch, and where the ends of one touch each other.

    Raises:
        ConfigError: two lines cross so close above each other that they can neither join nor pass.
    """
    trees = [_tree(line) for line in lines]
    found = []
    for i, j in combinations(range(len(lines)), 2):
        for meeting in _of_two(i, lines[i], j, lines[j], trees[j]):
            apart = _heights_apart(lines, meeting)
            if apart <= JOIN_M:
                found.append(meeting)
            elif apart <= PASS_M:
                x, y = lines[i].at(np.array([meeting.first_m]))[0, :2]
                raise ConfigError(
                    f"'{names[i]}' and '{names[j]}' cross {apart:.1f} m above each other at ({x:.0f}, {y:.0f}): they join "
                    f"within {JOIN_M} m, and pass with more than {PASS_M:g} m"
                )
    return found + [Meeting(k, 0.0, k, line.length_m) for k, line in enumerate(lines) if _closes(line)]


def _closes(line: CentreLine) -> bool:
    ends = line.at(np.array([0.0, line.length_m]))[:, :3]
    return bool(np.linalg.norm(ends[1] - ends[0]) <= JOIN_M)


def _tree(line: CentreLine) -> KDTree:
    return KDTree(_flattened(line)[::_EVERY])


def _flattened(line: CentreLine) -> FloatArray:
    """Return a line's samples (N, 3), with heights so small that what can neither join nor pass is near, too."""
    return np.stack([line.x_m, line.y_m, _FLAT * line.z_m], axis=1)


def _of_two(i: int, a: CentreLine, j: int, b: CentreLine, tree: KDTree) -> list[Meeting]:
    """Return where two lines meet in plan, and are at most `PASS_M` above each other."""
    at = np.unique(np.append(np.arange(0, len(a.s_m), _EVERY), len(a.s_m) - 1))
    distance, index = tree.query(_flattened(a)[at], distance_upper_bound=JOIN_M + _NEAR_M + _FLAT * PASS_M)
    other = np.minimum(index * _EVERY, len(b.s_m) - 1)
    in_plan = np.hypot(a.x_m[at] - b.x_m[other], a.y_m[at] - b.y_m[other]) <= JOIN_M + _NEAR_M
    near = np.flatnonzero(np.isfinite(distance) & in_plan & (np.abs(a.z_m[at] - b.z_m[other]) <= PASS_M))
    found = []
    while near.size:
        best = near[np.argmin(distance[near])]
        s = float(a.s_m[at[best]])
        here = np.abs(a.s_m[at[near]] - s) < _APART_M
        places = a.s_m[at[near[here]]]
        if np.ptp(places) > 2.0 * _APART_M - 1.0:
            raise ConfigError(f"two drifts run along each other at ({a.x_m[at[best]]:.0f}, {a.y_m[at[best]]:.0f})")
        found.append(_refined(Meeting(i, s, j, float(b.s_m[other[best]])), a, b))
        near = near[~here]
    return found


def _refined(meeting: Meeting, a: CentreLine, b: CentreLine) -> Meeting:
    """Return the meeting to a sample of both lines."""
    window = round(0.3 / STEP_M)
    ia, ib = (int(np.searchsorted(line.s_m, s)) for line, s in ((a, meeting.first_m), (b, meeting.second_m)))
    ra = np.arange(max(ia - window, 0), min(ia + window + 1, len(a.s_m)))
    rb = np.arange(max(ib - window, 0), min(ib + window + 1, len(b.s_m)))
    apart = np.hypot(a.x_m[ra][:, None] - b.x_m[rb], a.y_m[ra][:, None] - b.y_m[rb])
    k, m = np.unravel_index(int(np.argmin(apart)), apart.shape)
    return meeting._replace(first_m=float(a.s_m[ra[k]]), second_m=float(b.s_m[rb[m]]))


def _heights_apart(lines: Sequence[CentreLine], meeting: Meeting) -> float:
    first = lines[meeting.first].at(np.array([meeting.first_m]))[0]
    second = lines[meeting.second].at(np.array([meeting.second_m]))[0]
    return abs(float(first[2] - second[2]))


def _distance_to_polyline(point_m: FloatArray, points_m: FloatArray) -> float:
    """Return the distance of a point (3,) from a polyline (N, 3) in space."""
    start, leg = points_m[:-1], np.diff(points_m, axis=0)
    share = np.clip(((point_m - start) * leg).sum(axis=1) / np.maximum((leg * leg).sum(axis=1), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * leg - point_m, axis=1).min())
