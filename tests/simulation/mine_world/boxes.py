"""A straight drift with flat walls."""

from __future__ import annotations

import numpy as np
from lhdmap.simulation.drift import Mesh

HALF_M, HEIGHT_M, LENGTH_M = 2.0, 3.5, 40.0


def tunnel() -> Mesh:
    """Return a straight box of a drift along x, floor at z = 0."""
    x = np.arange(0.0, LENGTH_M + 0.1, 0.25)
    ring = np.array([[-HALF_M, 0.0], [-HALF_M, HEIGHT_M], [HALF_M, HEIGHT_M], [HALF_M, 0.0]])
    vertices = np.concatenate([np.column_stack([np.full(4, at), ring]) for at in x])
    sides = [[k, (k + 1) % 4, k + 4] for k in range(4)] + [[(k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    triangles = np.concatenate([np.array(sides) + 4 * n for n in range(len(x) - 1)])
    return Mesh(vertices, triangles.astype(np.uint32))
