"""Clouds of a drift that ends in a pile, sampled from planes of known place; the surfaces are exact, no ray is cast."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from lhdmap.geometry.se3 import from_rpy
from lhdmap.messages import FloatArray

TOE_M = 30.0
SEEN_M = 12.0
SPACING_M = 0.05


@dataclass(frozen=True)
class PiledDrift:
    """Walls at +-width/2, a floor at z = 0, a face that starts at x = 30 m, seen up to 1.6 m high over the last 12 m."""

    slope_deg: float = 50.0
    width_m: float = 4.0
    top_m: float = 1.6
    rubble_m: float = 0.0
    heading_rad: float = 0.0
    seed: int = 0

    def cloud(self) -> FloatArray:
        """Return points, shape (N, 3); `rubble_m` is the standard deviation of bumps of 0.4 m on the face."""
        points = np.concatenate([self._floor(), self._wall(-1.0), self._wall(1.0), self.face()])
        return points @ self.R_map_drift.T

    def face(self) -> FloatArray:
        """Return points of the face in the drift's frame, shape (N, 3)."""
        y, z = _grid((-self.width_m / 2, self.width_m / 2), (0.0, self.top_m))
        x = TOE_M + z / math.tan(math.radians(self.slope_deg))
        return np.column_stack([x + self._bumps(y, z), y, z])

    @property
    def R_map_drift(self) -> FloatArray:  # noqa: N802
        """Return the rotation of the drift in the map, shape (3, 3)."""
        return from_rpy(0.0, 0.0, self.heading_rad)[:3, :3]

    def T_map_base(self, distance_m: float = 15.0) -> FloatArray:  # noqa: N802
        """Return the machine on the drift's axis, `distance_m` before the toe, shape (4, 4)."""
        T = from_rpy(0.0, 0.0, self.heading_rad)
        T[:3, 3] = self.R_map_drift @ [TOE_M - distance_m, 0.0, 0.0]
        return T

    def _floor(self) -> FloatArray:
        x, y = _grid((TOE_M - SEEN_M, TOE_M), (-self.width_m / 2, self.width_m / 2))
        return np.column_stack([x, y, np.zeros(len(x))])

    def _wall(self, side: float) -> FloatArray:
        x, z = _grid((TOE_M - SEEN_M, TOE_M + 2.0), (0.0, self.top_m))
        seen = z >= (x - TOE_M) * math.tan(math.radians(self.slope_deg))
        return np.column_stack([x, np.full(len(x), side * self.width_m / 2), z])[seen]

    def _bumps(self, y: FloatArray, z: FloatArray) -> FloatArray:
        rng = np.random.default_rng(self.seed)
        heights = rng.normal(0.0, 1.0, (64, 64))
        return self.rubble_m * heights[(y / 0.4).astype(int) % 64, (z / 0.4).astype(int) % 64]


def _grid(first: tuple[float, float], second: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    a, b = (np.arange(low + SPACING_M / 2, high, SPACING_M) for low, high in (first, second))
    one, other = np.meshgrid(a, b, indexing="ij")
    return one.ravel(), other.ravel()
