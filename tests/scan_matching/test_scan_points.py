"""Which ranges are hits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.messages import LaserScan
from lhdmap.scan_matching.scan_points import planar_points


@pytest.mark.parametrize("nothing", [0.0, -1.0, math.inf, math.nan, 31.0])
@pytest.mark.parametrize("range_min_m", [0.0, 0.1])
def test_what_is_no_hit_is_left_out(nothing: float, range_min_m: float) -> None:
    """Zero is no return in many drivers, also where the stated limits begin at zero."""
    ranges = np.array([5.0, nothing, 5.0, nothing], np.float32)
    scan = LaserScan(0, "laser", 0.0, math.pi / 2, 0.0, range_min_m, 30.0, ranges)
    points = planar_points(scan, np.eye(4), np.zeros(3))
    assert points == pytest.approx(np.array([[5.0, 0.0, 0.0], [-5.0, 0.0, 0.0]]), abs=1e-6)
