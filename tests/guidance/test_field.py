"""The field against brute force: distances, and the sign beyond a wall."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.guidance.field import FAR_M, clearance, distance, field_around
from lhdmap.messages import FloatArray

WAY = np.column_stack([np.linspace(0.0, 8.0, 25), np.zeros(25)])


def wall(y: float, gap_m: float = 0.05) -> FloatArray:
    x = np.arange(-6.0, 14.0, gap_m)
    return np.column_stack([x, np.full(len(x), y)])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_distances_are_those_of_the_nearest_hit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hits = rng.uniform([-5.0, -5.0], [13.0, 5.0], (60, 2))
    field = field_around(hits, WAY)
    for x, y in rng.uniform([-3.0, -3.0], [11.0, 3.0], (100, 2)).tolist():
        true = min(float(np.hypot(*(hits - [x, y]).T).min()), FAR_M)
        assert true - 1e-9 <= distance(x, y, field)[0] <= true + 0.10  # of two hits in one cell the outer one goes


def test_of_many_hits_the_innermost_counts() -> None:
    rng = np.random.default_rng(1)
    thick = np.vstack([wall(2.0 + off, 0.02) for off in rng.uniform(0.0, 0.3, 8)] + [wall(2.0, 0.1)])
    field = field_around(thick, WAY)
    found = [distance(x, 1.5, field)[0] for x in np.linspace(0.0, 8.0, 50)]
    assert max(found) < 0.5 + 0.02


@pytest.mark.parametrize("y", [-3.0, -2.1, -1.9, -1.5, -1.0, 0.5, 1.5, 1.9, 2.1, 2.6, 3.4])
def test_the_clearance_of_a_point_is_signed_by_the_walls_between(y: float) -> None:
    field = field_around(np.vstack([wall(2.0), wall(-2.0)]), WAY)
    axis = np.sign(y) * min(abs(y), 1.0) * 0.5
    d, nx, ny = clearance(4.013, y, 4.0, axis, field)
    assert d == pytest.approx(2.0 - abs(y), abs=0.07)
    assert ny * np.sign(y) < -0.9
    assert nx == pytest.approx(0.0, abs=0.3)


def test_a_wall_with_gaps_is_not_crossed() -> None:
    """A flood leaks through gaps between hits; what is looked through from within must be wider than the look is thick."""
    field = field_around(wall(2.0, 0.09), WAY)
    assert all(clearance(x, 2.4, x, 0.0, field)[0] < -0.3 for x in np.linspace(0.0, 8.0, 161))


def test_nothing_around_is_far() -> None:
    field = field_around(np.zeros((0, 2)), WAY)
    assert clearance(1.0, 1.0, 1.0, 0.0, field) == (FAR_M, 0.0, 0.0)
    assert distance(500.0, 500.0, field)[0] == FAR_M
