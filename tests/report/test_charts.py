"""Helpers of the charts: thinning that loses no dip, stretches, the unrolled side view, rasters."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.report.charts import envelope, stretches, thinned
from lhdmap.report.cloud_charts import count_raster, mean_raster, unrolled


@given(st.integers(0, 20_000), st.integers(2, 500))
def test_thinned_rows_keep_both_ends(length: int, most: int) -> None:
    rows = thinned(length, most)
    assert len(rows) <= 2 * most + 1
    if length:
        assert (rows[0], rows[-1]) == (0, length - 1)
        assert (np.diff(rows) > 0).all()


def test_envelope_keeps_a_dip_of_one_sample_and_gaps() -> None:
    x = np.arange(50_000.0)
    y = np.ones(50_000)
    y[31_234] = -5.0
    y[10_000:20_000] = np.nan
    few_x, few_y = envelope(x, y)
    assert len(few_x) <= 1400
    assert np.nanmin(few_y) == -5.0
    assert abs(few_x[np.nanargmin(few_y)] - 31_234) < 100
    assert np.isnan(few_y[(few_x > 10_200) & (few_x < 19_800)]).all()


@given(st.lists(st.booleans(), max_size=50))
def test_stretches_are_the_runs_of_true(flags: list[bool]) -> None:
    again = np.zeros(len(flags), dtype=bool)
    runs = stretches(np.array(flags, dtype=bool))
    for first, last in runs:
        again[first : last + 1] = True
    assert again.tolist() == flags
    assert all(later[0] > earlier[1] + 1 for earlier, later in itertools.pairwise(runs))


def test_side_view_unrolls_a_bend() -> None:
    angle = np.linspace(0, np.pi / 2, 2000)
    path = 50.0 * np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * angle])
    walls = np.vstack([[r * np.sin(angle), 50 - r * np.cos(angle), 0 * angle + 1.0] for r in (48.0, 52.0)])
    points = np.concatenate([walls[:3].T, walls[3:].T]).astype(np.float32)
    along, path_along, path_z = unrolled(points, path)
    assert np.abs(along - np.tile(50.0 * angle, 2)).max() < 0.3
    assert path_along[-1] == pytest.approx(50 * np.pi / 2, rel=1e-4)
    assert not path_z.any()


def test_rasters_place_points_and_leave_the_rest_empty() -> None:
    x, y, z = np.array([0.0, 0.05, 9.95]), np.array([0.0, 0.05, 4.95]), np.array([1.0, 3.0, 7.0])
    raster = mean_raster(x, y, z, least_cell_m=0.1)
    assert raster.values[0, 0] == 2.0
    assert raster.values[-1, -1] == 7.0
    assert np.isfinite(raster.values).sum() == 2
    assert raster.extent == pytest.approx((0.0, 10.0, 0.0, 5.0), abs=0.11)
    assert np.isfinite(count_raster(x, y).values).sum() == 2
