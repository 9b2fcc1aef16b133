"""Points in a convex polygon, against half-planes and turned squares."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.geometry.polygon import inside

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@given(
    st.floats(-math.pi, math.pi),
    st.floats(-50.0, 50.0),
    st.floats(-50.0, 50.0),
    st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)), min_size=1, max_size=20),
)
def test_a_square_anywhere(turn: float, x: float, y: float, places: list[tuple[float, float]]) -> None:
    points = np.array(places)
    edge = np.abs(np.abs(points).max(axis=1) - 1.0)
    points = points[edge > 1e-6]
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    found = inside(points @ rotation.T + (x, y), SQUARE @ rotation.T + (x, y))
    assert (found == (np.abs(points).max(axis=1) < 1.0)).all()


def test_nothing_is_in_no_polygon() -> None:
    assert not inside(np.zeros((3, 2)), np.zeros((0, 2))).any()
    assert inside(np.zeros((0, 2)), SQUARE).shape == (0,)
