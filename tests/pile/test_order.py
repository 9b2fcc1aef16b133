"""Order statistics in place: against numpy's, which sort."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.pile.order import cell_numbers, grouped, quantile, select, spread_about, weighted_median

values = st.lists(st.one_of(st.floats(-50.0, 50.0), st.integers(-3, 3).map(float)), min_size=1, max_size=40).map(
    np.array
)


@settings(max_examples=100, deadline=None)
@given(values, st.floats(0.0, 1.0))
def test_quantile_is_that_of_numpy(x: FloatArray, share: float) -> None:
    assert quantile(x.copy(), len(x), share) == pytest.approx(np.quantile(x, share), abs=1e-9)
    middle = float(np.median(x))
    assert spread_about(x.copy(), len(x), middle) == pytest.approx(1.4826 * np.median(np.abs(x - middle)), abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(values, st.integers(0, 39))
def test_select_parts_the_values(x: FloatArray, k: int) -> None:
    k = min(k, len(x) - 1)
    scratch = x.copy()
    assert select(scratch, len(x), k) == np.sort(x)[k]
    assert scratch[:k].max(initial=-math.inf) <= scratch[k] <= scratch[k + 1 :].min(initial=math.inf)
    assert sorted(scratch) == sorted(x)


@settings(max_examples=100, deadline=None)
@given(values, st.integers(0, 2**32 - 1))
def test_weighted_median_is_the_median_of_repeated_values(x: FloatArray, seed: int) -> None:
    weights = np.random.default_rng(seed).integers(1, 5, len(x))
    repeated = np.sort(np.repeat(x, weights))
    found = weighted_median(x.copy(), weights.astype(np.float64))
    assert found == repeated[(len(repeated) - 1) // 2]


@settings(max_examples=100, deadline=None)
@given(values, st.sampled_from([0.1, 0.3, 2.0]))
def test_cells_hold_what_lies_in_them(u: FloatArray, cell_m: float) -> None:
    v = u[::-1].copy()
    numbers, count = cell_numbers(u, v, cell_m)
    assert 0 <= numbers.min() <= numbers.max() < count
    cells = list(zip(np.floor(u / cell_m), np.floor(v / cell_m), strict=True))
    assert np.argsort(numbers, kind="stable").tolist() == sorted(range(len(u)), key=lambda i: cells[i])
    sorted_u, starts = grouped(u, numbers, count)
    assert starts[-1] == len(u)
    for k in set(numbers):
        assert sorted_u[starts[k] : starts[k + 1]].tolist() == u[numbers == k].tolist()
