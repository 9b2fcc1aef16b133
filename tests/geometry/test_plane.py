"""Robust planes: what does not belong to the plane does not move it."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.geometry.plane import Weigh, Weights, robust_plane, tukey
from lhdmap.messages import FloatArray

TRUE = np.array([0.4, -0.3, 0.8])


def within(residuals: FloatArray, _: Weights) -> Weights | None:
    near: Weights = np.abs(residuals) < max(2.5 * float(np.median(np.abs(residuals))), 1e-3)
    return near if np.count_nonzero(near) >= 3 else None


@pytest.mark.parametrize("weigh", [tukey, within])
def test_a_boulder_does_not_move_the_plane(weigh: Weigh) -> None:
    rng = np.random.default_rng(2)
    places = rng.uniform(-2.0, 2.0, (400, 2))
    values = TRUE[0] + places @ TRUE[1:] + rng.normal(0.0, 0.01, 400)
    values[:60] += rng.uniform(0.3, 1.0, 60)
    found = robust_plane(places, values, weigh, rounds=20)
    assert found.determined
    assert found.terms == pytest.approx(TRUE, abs=0.005)
    assert np.count_nonzero(found.weights[:60]) == 0


def test_places_on_a_line_determine_no_plane() -> None:
    along = np.linspace(0.0, 1.0, 20)
    assert not robust_plane(np.column_stack([along, 2.0 * along]), along, tukey, rounds=3).determined


def test_where_nothing_is_left_all_counts() -> None:
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    found = robust_plane(places, np.array([0.0, 0.0, 0.0, 1.0]), lambda _, __: None, rounds=3)
    assert found.weights.all()
