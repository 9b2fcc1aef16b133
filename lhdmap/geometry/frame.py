"""Frames that are turned about the upright axis alone: of a drift's end, of a pile, of what stands in them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray


class UprightFrame(NamedTuple):
    """A frame turned about the upright axis: origin (3,), m, and heading (rad) of its x axis, in the map."""

    origin_m: FloatArray
    heading_rad: float

    def local(self, points_map: FloatArray) -> FloatArray:
        """Return points (..., 3) of the map in this frame."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        d = points_map - self.origin_m
        x, y = d[..., 0], d[..., 1]
        return np.stack([c * x + s * y, -s * x + c * y, d[..., 2]], axis=-1)

    def map(self, points_local: FloatArray) -> FloatArray:
        """Return points (..., 3) of this frame in the map."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        x, y = points_local[..., 0], points_local[..., 1]
        return np.stack([c * x - s * y, s * x + c * y, points_local[..., 2]], axis=-1) + self.origin_m

    def turned(self, at_local: FloatArray, turn_rad: float) -> UprightFrame:
        """Return the frame with its origin at a point (3,) of this one, turned left."""
        return UprightFrame(self.map(at_local), self.heading_rad + turn_rad)
