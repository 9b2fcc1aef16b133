"""The order of least time, against all orders there are."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.rockbreaker.order import best_order, order_s


def _times(seed: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times that differ by direction, as those of the arm do."""
    rng = np.random.default_rng(seed)
    return rng.uniform(1.0, 9.0, count), rng.uniform(1.0, 9.0, (count, count)), rng.uniform(1.0, 9.0, count)


@given(st.integers(0, 10_000), st.integers(1, 6))
def test_no_order_is_faster(seed: int, count: int) -> None:
    times = _times(seed, count)
    best = best_order(*times)
    assert sorted(best) == list(range(count))
    assert order_s(best, *times) == pytest.approx(min(order_s(one, *times) for one in permutations(range(count))))


def test_seven_places_by_brute_force() -> None:
    times = _times(7, 7)
    assert order_s(best_order(*times), *times) == pytest.approx(
        min(order_s(one, *times) for one in permutations(range(7)))
    )


def test_a_dozen_on_a_line_are_gone_through_from_one_end_to_the_other() -> None:
    """Closed form: from before the first to behind the last the way is the line's length."""
    places = np.random.default_rng(1).permutation(12).astype(float)
    between = np.abs(places[:, None] - places)
    best = best_order(places + 1.0, between, 12.0 - places)
    assert [places[k] for k in best] == list(range(12))
    assert order_s(best, places + 1.0, between, 12.0 - places) == 13.0


def test_more_than_a_dozen_are_near_the_best() -> None:
    angle = 2.0 * np.pi * np.random.default_rng(2).permutation(16) / 16.0
    at = np.column_stack([np.cos(angle), np.sin(angle)])
    between = np.linalg.norm(at[:, None] - at, axis=-1)
    start = np.linalg.norm(at - [1.0, 0.0], axis=1)
    best = best_order(start, between, start)
    assert sorted(best) == list(range(16))
    assert order_s(best, start, between, start) == pytest.approx(32.0 * np.sin(np.pi / 16.0), rel=1e-9)  # once round


def test_a_place_that_cannot_be_left_comes_last() -> None:
    start, between, end = (np.ones(3), np.ones((3, 3)), np.ones(3))
    between[1] = np.inf
    assert best_order(start, between, end)[-1] == 1
    assert best_order(np.zeros(0), np.zeros((0, 0)), np.zeros(0)) == ()
