"""How much of a pile's face was hit by a moment, with true poses: what was not hit nobody can report."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from lhdmap.config import Settings
from lhdmap.messages import FloatArray
from lhdmap.pipeline.given import given_rows
from lhdmap.pipeline.identify import placed_along
from lhdmap.simulation.pile_facts import FacePlane, PileTruth

_NEAR_M, _WALL_M = 0.5, 0.15
_LOW_M, _HIGH_M = 0.2, 1.8
_FEWEST = 40


def seen_height_m(log: Path, truth: PileTruth, until_ns: int) -> float:
    """Return over how much height the face was hit until then (2nd to 98th percentile of its hits), 0 where it was not."""
    if truth.plane is None:
        return 0.0
    scans = placed_along(given_rows("ground-truth", [log], {}), [log], Settings(), None)
    early = [scan.hits().points_map for scan in scans if scan.scan.stamp_ns <= until_ns]
    seen = _on_face(np.concatenate([np.zeros((0, 3)), *early]), truth, truth.plane)
    return float(np.ptp(np.quantile(seen, (0.02, 0.98)))) if len(seen) >= _FEWEST else 0.0


def _on_face(points_map: FloatArray, truth: PileTruth, plane: FacePlane) -> FloatArray:
    """Return the heights over the floor of those hits (N, 3) that lie on the true face."""
    cos, sin = math.cos(truth.end_heading_rad), math.sin(truth.end_heading_rad)
    dx, dy = (points_map[:, :2] - truth.center_m[:2]).T
    x, y, z = cos * dx + sin * dy, -sin * dx + cos * dy, points_map[:, 2] - truth.floor_m
    inside = (np.abs(y) < min(truth.left_m, truth.right_m) - _WALL_M) & (z > _LOW_M) & (z < _HIGH_M)
    heights: FloatArray = z[inside & (np.abs(x - plane.x_m(y, z)) < _NEAR_M)]
    return heights
