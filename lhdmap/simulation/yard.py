"""Open ground on which things come and go: boxes that the eyes of a machine see, and that its bodies touch."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.drift import Mesh

_SPACING_M = 0.2


class Yard:
    """The ground; rays meet nothing on it, `outlines_m` is what the eyes see."""

    origin_m = np.zeros(3)

    def __init__(self) -> None:
        self.boxes_m: dict[str, FloatArray] = {}
        self.outlines_m = np.zeros((0, 2))

    def appear(self, name: str, mesh: Mesh) -> None:
        """Put something onto it."""
        self.boxes_m[name] = np.stack([mesh.vertices_m[:, :2].min(axis=0), mesh.vertices_m[:, :2].max(axis=0)])
        self._drawn()

    def vanish(self, name: str) -> None:
        """Take it away again."""
        self.boxes_m.pop(name, None)
        self._drawn()

    def near(self, _position_m: FloatArray) -> Yard:
        """Return itself."""
        return self

    def cast(self, rays: Float32Array) -> Float32Array:
        """Return that no ray meets anything."""
        return np.full(len(rays), np.inf, dtype=np.float32)

    def dust(self, _position_m: FloatArray) -> float:
        """Return that none hangs anywhere."""
        return 0.0

    def _drawn(self) -> None:
        lines = [_outline(low, high) for low, high in self.boxes_m.values()]
        self.outlines_m = np.concatenate(lines) if lines else np.zeros((0, 2))


def _outline(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return points around a box, (K, 2)."""
    xs, ys = (np.linspace(a, b, max(math.ceil((b - a) / _SPACING_M), 1) + 1) for a, b in zip(low, high, strict=True))
    sides = [np.column_stack([xs, np.full(len(xs), y)]) for y in (low[1], high[1])]
    ends = [np.column_stack([np.full(len(ys), x), ys]) for x in (low[0], high[0])]
    return np.concatenate([*sides, *ends])
