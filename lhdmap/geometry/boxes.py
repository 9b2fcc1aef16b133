"""Boxes along the axes of a frame: lower and upper corners, shape (N, 2, 3), or as rows of six, shape (N, 6)."""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray


def grown(boxes_m: FloatArray, margin_m: float) -> FloatArray:
    """Return boxes, shape (N, 2, 3) or (N, 6), as rows (N, 6) of lower and upper corner, `margin_m` larger on all sides."""
    rows = boxes_m.reshape(-1, 6).astype(np.float64)
    rows[:, :3] -= margin_m
    rows[:, 3:] += margin_m
    return rows
