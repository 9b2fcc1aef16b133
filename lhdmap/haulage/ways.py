"""Ways over a site as they are driven: edges one after the other, their corners drawn with curvature that grows and falls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.haulage.layout import Layout
from lhdmap.haulage.states import State
from lhdmap.messages import FloatArray
from lhdmap.tracking.path import STEP_M, path_of

SMOOTHING_M = 1.5
"""Over so much the curvature of corners grows and falls."""
_SAME_M, _SPACING_M, _BEYOND_M = 1e-3, 1.0, 10.0
_MORE = 0.2  # of a step
_CREEP_KMH = 10.0
LANES = frozenset({State.ROAD, State.THROUGH, State.JUNCTION_ON, State.JUNCTION_OFF})
"""Kinds of edges on which a machine has a lane to keep; in an area it has an apron."""


class Way(NamedTuple):
    """Waypoints (N, 2) in the order in which they are driven, speed (m/s) and edge (N,) of each, the kinds of the edges.

    `dock`: edge at whose end it backs in after it, from the last waypoint on; -1: none.
    """

    points_m: FloatArray
    speeds_mps: FloatArray
    edges: FloatArray
    dock: int = -1


def way_of(layout: Layout, edges: Sequence[int], smoothing_m: float = SMOOTHING_M) -> Way:
    """Return the way along edges that follow each other, up to the end of the last, or to where it backs in.

    The edges' lines are of straights and arcs; over `smoothing_m` the curvature of one becomes that of the next (0: as a step).

    Raises:
        InputError: an edge does not begin where the one before ends, or has no line.
    """
    points, speeds, numbers = [], [], []
    dock = -1
    for place, k in enumerate(edges):
        edge = layout.edges[k]
        if edge.line_m is None or (place and layout.edges[edges[place - 1]].end != edge.start):
            raise InputError(f"edge {edge.start} to {edge.end}: it has no line, or does not follow the one before")
        line = edge.line_m[:, :2]
        if np.isfinite(edge.reverse_from_m):
            line, dock = _up_to(line, edge.reverse_from_m), k
        points.append(line)
        speeds.append(np.full(len(line), (edge.speed_kmh or _CREEP_KMH) / 3.6))
        numbers.append(np.full(len(line), float(k)))
    if not points:
        raise InputError("a way has at least one edge")
    whole = np.concatenate(points)
    keep = np.append(np.hypot(*np.diff(whole, axis=0).T) > _SAME_M, True)
    drawn = Way(whole[keep], np.concatenate(speeds)[keep], np.concatenate(numbers)[keep], dock)
    return drawn if smoothing_m <= 0.0 else _smoothed(drawn, smoothing_m)


def _smoothed(way: Way, smoothing_m: float) -> Way:
    """Return a way with rounded curvature, waypoints about each metre; beyond both ends it is taken to go on straight."""
    line = way.points_m
    on = np.arange(1.0, _BEYOND_M + 0.5)[:, None]
    before = line[0] - on[::-1] * _unit(line[1] - line[0])
    after = line[-1] + on * _unit(line[-1] - line[-2])
    rows = path_of(np.concatenate([before, line, after]), smoothing_m, 0.0).points
    first, last = (_place_on(rows, end) for end in (line[0], line[-1]))
    first = last - np.ceil(
        last - first
    )  # a path is cut to whole steps from its start: its end is where the machine stops
    last += _MORE
    at = np.linspace(first, last, max(round(STEP_M * (last - first) / _SPACING_M), 3) + 1)
    points = np.column_stack([np.interp(at, np.arange(len(rows)), rows[:, k]) for k in range(2)])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    share = np.linspace(0.0, along[-1], len(points))
    index = np.clip(np.searchsorted(along, share, side="right") - 1, 0, len(along) - 1)
    return Way(points, way.speeds_mps[index], way.edges[index], way.dock)


def _place_on(rows: FloatArray, point_m: FloatArray) -> float:
    """Return the index, with its fraction, of where a point is beside rows of a path."""
    k = int(np.argmin(np.hypot(*(rows[:, :2] - point_m).T)))
    gap = point_m - rows[k, :2]
    return k + float(gap[0] * np.cos(rows[k, 2]) + gap[1] * np.sin(rows[k, 2])) / STEP_M


def _unit(step_m: FloatArray) -> FloatArray:
    found: FloatArray = step_m / np.hypot(*step_m)
    return found


def _up_to(line: FloatArray, length_m: float) -> FloatArray:
    """Return the points of a line up to a length."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    return line[: int(np.searchsorted(along, length_m - _SAME_M)) + 1]


def pose_at_end(layout: Layout, k: int) -> FloatArray:
    """Return x, y and heading of the front axle at the end of an edge (3,); who backs in looks the other way.

    Raises:
        InputError: the edge has no line.
    """
    edge = layout.edges[k]
    if edge.line_m is None:
        raise InputError(f"edge {edge.start} to {edge.end} has no line")
    turned = np.pi if np.isfinite(edge.reverse_from_m) else 0.0
    return np.array([*edge.line_m[-1, :2], heading_at_end(edge.line_m[:, :2]) + turned])


def heading_at_end(line_m: FloatArray) -> float:
    """Return the heading of the last piece of a line, rad."""
    x, y = line_m[-1] - line_m[-2]
    return float(np.arctan2(y, x))


def apron_of(layout: Layout, area: str, room_m: float) -> FloatArray:
    """Return the corners (N, 2) of the ground of an area, as the site has them.

    Where it does not say: the rectangle around all ways in it, along the heading at the queue point, and `room_m` more.
    """
    if area in layout.aprons:
        return layout.aprons[area]
    lines = [
        one.line_m for one in layout.edges if one.area == area and one.line_m is not None and one.kind not in LANES
    ]
    points = np.concatenate([line[:, :2] for line in lines])
    queue = next(
        one for one in layout.edges if one.area == area and one.kind == State.AREA_IN and one.line_m is not None
    )
    assert queue.line_m is not None  # noqa: S101  # asked for in the line before
    heading = heading_at_end(queue.line_m)
    c, s = np.cos(heading), np.sin(heading)
    turned = points @ np.array([[c, -s], [s, c]])
    low, high = turned.min(axis=0) - room_m, turned.max(axis=0) + room_m
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    found: FloatArray = corners @ np.array([[c, s], [-s, c]])
    return found
