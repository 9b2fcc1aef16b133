"""Axes of short arms: where corners leave hardly a straight wall between two junctions, the drift goes on beyond them.

An arm with a long straight beginning tells its own direction. A short one is fitted together with the arm opposite it, and with
the one beyond its far junction, as long as all of them lie on one line: of their middles between both walls only those count where
the drift is as narrow as it is, and not a mouth or a rounded corner.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.topology.arms import FIT_M, FROM_RADII, Axis, fitted, is_narrow, normal, roughness_m, sides, unit
from lhdmap.topology.driven import arc_m
from lhdmap.topology.room import Room
from lhdmap.topology.skeleton import Line

LONG_M = 8.0
"""An arm with so much straight wall needs no other."""
COLLINEAR = math.cos(math.radians(20.0))
_OWN_FROM = 0.8  # free radii
_FEWEST, _SHORTEST_M, _OFF_M = 8, 6.0, 0.3
_ROUNDS = 2


def direction_of(arm: Line, centre_m: FloatArray, radius_m: float) -> FloatArray:
    """Return the unit vector (2,) in which an arm that leaves a junction at `centre_m` (2,) goes on the whole."""
    away = np.linalg.norm(arm.points_m - centre_m, axis=1)
    near = arm.points_m[away < 2.0 * FIT_M + radius_m]
    return unit((near if len(near) else arm.points_m)[-1] - centre_m)


def fitted_part(arm: Line, centre_m: FloatArray, radius_m: float, far_radius_m: float) -> FloatArray:
    """Return the points (N, 2) of an arm that its own axis is fitted to."""
    return _part(arm, centre_m, FROM_RADII * radius_m, FROM_RADII * far_radius_m)


def inner_part(arm: Line, centre_m: FloatArray, radius_m: float, far_radius_m: float) -> FloatArray:
    """Return the points (N, 2) of a short arm: all but the middles of the junctions at its ends."""
    return _part(arm, centre_m, _OWN_FROM * radius_m, _OWN_FROM * far_radius_m)


def axis_of_parts(own: Axis, chord: FloatArray, parts: list[FloatArray], room: Room) -> Axis:
    """Return the axis of an arm from points (N, 2) of several arms on one line, `own` where they are not on one.

    `chord` (2,): unit vector along the arm.
    """
    points = np.concatenate(parts)
    if len(points) < _FEWEST:
        return own
    direction = chord
    for _ in range(_ROUNDS):
        left, right = sides(points, direction, room)
        width = left + right
        narrow = is_narrow(width)
        middles = points[narrow] + 0.5 * (left - right)[narrow, None] * normal(direction)
        if len(middles) < _FEWEST:
            return own
        direction, point = fitted(middles, chord)
    along = (middles - point) @ direction
    off = np.abs((middles - point) @ normal(direction))
    length = float(along.max() - along.min())
    if length < _SHORTEST_M or float(np.quantile(off, 0.8)) > _OFF_M or float(direction @ chord) < COLLINEAR:
        return own
    half = 0.5 * float(np.median(width[narrow]))
    return Axis(direction, point, half, min(0.5 * length, FIT_M), roughness_m(left[narrow], right[narrow]))


def _part(arm: Line, centre_m: FloatArray, from_m: float, before_m: float) -> FloatArray:
    away, along = np.linalg.norm(arm.points_m - centre_m, axis=1), arc_m(arm.points_m)
    begin = float(along[int(np.argmax(away > from_m))]) if (away > from_m).any() else float(along[-1])
    chosen: FloatArray = arm.points_m[(along >= begin) & (along <= min(begin + FIT_M, float(along[-1]) - before_m))]
    return chosen
