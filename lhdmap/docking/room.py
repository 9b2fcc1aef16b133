"""The room on an apron: what bounds it, what stands on it, and the bodies that have to fit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.docking.kernel import fits
from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.errors import InputError
from lhdmap.messages import FloatArray

_OUTLINE_M = 0.6
EVERY = 3
"""Each third state is looked at: 0.3 m."""


class Room(NamedTuple):
    """Corners (N, 2) of the apron, points (M, 2) that no body may cover, outlines of both bodies, lengths L0 and L1."""

    corners: FloatArray
    blocked: FloatArray
    outlines: tuple[FloatArray, FloatArray]
    lengths: tuple[float, float]

    def first_miss(self, states: FloatArray, every: int = EVERY) -> int:
        """Return the first state (of (N, 4) or more: rear axle, joint) at which a body does not fit, or -1."""
        return int(fits(states, every, self.outlines, self.corners, self.blocked, self.lengths))

    def free(self, states: FloatArray) -> bool:
        """Return whether both bodies fit along states."""
        return self.first_miss(states) < 0


def room_of(
    apron: FloatArray, model: DriveModel, bodies: Bodies, margin_m: float, blocked: FloatArray | None = None
) -> Room:
    """Return the room of an apron (N, 2), a polygon of either sense; bodies keep `margin_m` from what bounds it.

    Raises:
        InputError: the apron is no polygon of finite corners.
    """
    corners = np.asarray(apron, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
        raise InputError("an apron is a polygon: three or more corners, shape (N, 2), finite")
    points = np.zeros((0, 2)) if blocked is None else np.asarray(blocked, dtype=np.float64).reshape(-1, 2)
    outlines = (_outline(bodies.front_box_m, margin_m), _outline(bodies.rear_box_m, margin_m))
    return Room(np.ascontiguousarray(corners), np.ascontiguousarray(points), outlines, (model.front_m, model.rear_m))


def _outline(box: FloatArray, margin_m: float) -> FloatArray:
    """Return low and high corner of a grown box, then points around it, (K, 2)."""
    low, high = box[0] - margin_m, box[1] + margin_m
    xs = np.linspace(low[0], high[0], max(math.ceil((high[0] - low[0]) / _OUTLINE_M), 1) + 1)
    ys = np.linspace(low[1], high[1], max(math.ceil((high[1] - low[1]) / _OUTLINE_M), 1) + 1)[1:-1]
    sides = [np.column_stack([xs, np.full(len(xs), y)]) for y in (low[1], high[1])]
    ends = [np.column_stack([np.full(len(ys), x), ys]) for x in (low[0], high[0])]
    return np.ascontiguousarray(np.concatenate([low[None], high[None], *sides, *ends]))
