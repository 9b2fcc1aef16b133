"""The pile before another attempt: how far a face has moved, from the line that a scanner sees of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.loading.moment import Target
from lhdmap.loading.seen_again import face_behind_m, moved


def face(limits: np.ndarray, behind_m: float) -> np.ndarray:
    """Return hits on a face so far behind the toe, and on the walls beside it."""
    E = limits[1] - limits[0]
    normal = np.array([E[1], -E[0]]) / np.hypot(*E)
    share = np.linspace(0.02, 0.98, 60)[:, None]
    walls = np.vstack([limits[side] - normal * np.linspace(0.0, 8.0, 50)[:, None] for side in (0, 1)])
    return np.vstack([limits[0] + share * E + behind_m * normal, walls])


@given(st.floats(-1.2, 4.5), st.floats(-0.4, 0.4), st.floats(5.0, 15.0))
def test_a_face_is_found_behind_its_toe(behind_m: float, skew: float, ahead_m: float) -> None:
    limits = np.array([[ahead_m - 2.0 * math.tan(skew), -2.0], [ahead_m + 2.0 * math.tan(skew), 2.0]])
    assert face_behind_m(face(limits, behind_m), limits) == pytest.approx(behind_m, abs=1e-9)


def test_without_a_hit_there_is_no_face() -> None:
    limits = np.array([[10.0, -2.0], [10.0, 2.0]])
    assert math.isnan(face_behind_m(np.zeros((0, 2)), limits))
    assert math.isnan(face_behind_m(np.array([[3.0, 0.0]]), limits))
    assert math.isnan(face_behind_m(face(limits, 1.0), np.zeros((2, 2))))


def test_a_pile_moves_along_its_heading() -> None:
    target = Target(np.array([[10.0, -2.0], [10.0, 2.0]]), np.array([11.0, 0.0]), math.radians(30.0), 5)
    after = moved(target, 0.5, 9)
    assert after.limits_m - target.limits_m == pytest.approx(
        np.tile([0.5 * math.cos(math.radians(30.0)), 0.25], (2, 1))
    )
    assert (after.stamp_ns, after.heading_rad) == (9, target.heading_rad)
