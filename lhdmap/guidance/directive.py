"""What navigation asks of guidance: a path for the leading axle, how fast, and where to stop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

STEP_M = 0.25
X, Y, HEADING, SPEED, ROUTE, WAY = range(6)
"""Columns of a path: place, heading of motion, highest speed (m/s), weight of the route (1: as set), metres along."""


class Directive(NamedTuple):
    """`path` (N, 6) in `odom`, each 0.25 m, along which the leading axle moves in `gear`; `stop_m`: along it, inf: it goes on.

    `leaves`: it goes out of a pile by the way it came: where what slid down touches it, it creeps on while that gets no worse.
    """

    stamp_ns: int
    gear: int
    path: FloatArray
    stop_m: float
    leaves: bool = False


def path_of(line_m: FloatArray, speed_mps: FloatArray | float, route: FloatArray | float = 1.0) -> FloatArray:
    """Return the path (M, 6) along a line (N, 2); speeds and weights (N,) as at its points."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    wanted = np.linspace(0.0, along[-1], max(round(along[-1] / STEP_M), 1) + 1)
    x, y = np.interp(wanted, along, line_m[:, 0]), np.interp(wanted, along, line_m[:, 1])
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    columns = [np.interp(wanted, along, np.broadcast_to(values, along.shape)) for values in (speed_mps, route)]
    path: FloatArray = np.column_stack([x, y, heading, *columns, wanted])
    return path


def moved(path: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a path carried by a pose (3,): from one frame to another."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    out = path.copy()
    out[:, X] = pose[0] + c * path[:, X] - s * path[:, Y]
    out[:, Y] = pose[1] + s * path[:, X] + c * path[:, Y]
    out[:, HEADING] = path[:, HEADING] + pose[2]
    return out
