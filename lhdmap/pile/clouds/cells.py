"""Cells of a height map: holes filled, and the area of an outline."""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.clouds.height_map import Mask


def with_holes_filled(heights: FloatArray) -> tuple[FloatArray, Mask]:
    """Return heights (I, J) with enclosed holes filled from their neighbours, and which cells that were."""
    from scipy import ndimage

    known = np.isfinite(heights)
    holes = ndimage.binary_fill_holes(known) & ~known
    filled = heights.copy()
    todo = holes.copy()
    while todo.any():
        weights = ndimage.uniform_filter(np.isfinite(filled).astype(float), 3, mode="constant")
        sums = ndimage.uniform_filter(np.nan_to_num(filled), 3, mode="constant")
        now = todo & (weights > 1e-6)
        filled[now] = sums[now] / weights[now]
        todo &= ~now
    return filled, holes


def outline_m2(points_m: FloatArray) -> float:
    """Return the area of the convex outline of points (N, 2 or 3) from above, m²; 0 where they lie on a line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points_m[:, :2]).volume)
    except QhullError:
        return 0.0
