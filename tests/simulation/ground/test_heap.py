"""The pile as a field: turned, slid and dug without losing ore, and seen as it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.simulation.ground.field import ACROSS_M, ALONG_M
from lhdmap.simulation.raycast import Surface

from tests.simulation.ground.heaps import HALF_M, SLOPE, TOE_M, heap


@settings(max_examples=15, deadline=None)
@given(st.floats(-0.4, 0.4), st.floats(-0.8, 0.8))
def test_turning_keeps_ore_and_shape(heading: float, beside: float) -> None:
    one = heap()
    volume, points = (
        one.volume_m3,
        np.array([[TOE_M + 1.0, 0.0], [TOE_M + 2.0, 1.0], [TOE_M - 1.0, 0.0], [TOE_M + 7.0, -1.5]]),
    )
    before = one.height_at(points)
    for way in (1.0, -1.0, 1.0):
        left = one.turn_to(np.array([TOE_M - 2.0, beside]), way * heading)
    assert one.volume_m3 == pytest.approx(volume, abs=1e-6)
    assert one.height_at(points) == pytest.approx(before, abs=0.12)
    border = one.grid.places(np.array([TOE_M - 2.0, beside]))[1]
    assert left - border == pytest.approx(0.5, abs=1e-6)
    assert one.grid.shape[0] * one.grid.shape[1] < 80_000


def test_what_is_dug_comes_down_and_from_the_sides() -> None:
    one = heap()
    left = one.turn_to(np.array([TOE_M - 2.0, 0.0]), 0.0)
    columns = (left - 12, left + 11)
    slice_m = one.slice_m(*columns)
    before, x = one.volume_m3, one.grid.points()[:, 0, 0] - TOE_M
    dug = np.where((x > 0.0) & (x < 2.0), 0.0, slice_m)
    taken = float((slice_m - dug).sum()) * ALONG_M * 24 * ACROSS_M
    one.give_back(*columns, dug)
    assert one.volume_m3 == pytest.approx(before - taken, abs=1e-9)
    trench = one.slice_m(*columns)
    one.settle()
    assert one.volume_m3 == pytest.approx(before - taken, abs=1e-6)
    assert one.slice_m(*columns)[x < 2.0].sum() > trench[x < 2.0].sum() + 1.0
    beside = one.height_at(np.array([[TOE_M + 1.0, 1.9]]))[0]
    assert beside == pytest.approx(SLOPE, abs=0.05)  # ore came down over it
    points = one.grid.points()
    rows, columns_in = points[:, 0, 0] < 31.5, np.abs(points[0, :, 1]) < HALF_M - 0.1
    standing = one.heights_m[rows][:, columns_in]
    assert np.abs(np.diff(standing, axis=0)).max() < SLOPE * ALONG_M + 0.01
    assert np.abs(np.diff(standing, axis=1)).max() < SLOPE * ACROSS_M + 0.01


def test_a_bucket_keeps_the_sides_off() -> None:
    one = heap()
    left = one.turn_to(np.array([TOE_M - 2.0, 0.0]), 0.0)
    first, last = left - 12, left + 11
    slice_m = one.slice_m(first, last)
    x = one.grid.points()[:, 0, 0] - TOE_M
    one.give_back(first, last, np.where(x < 1.49, 0.0, slice_m))
    lip = int(np.flatnonzero(x > 1.49)[0])
    one.slide(1.0, 10.0, (first, last, lip, 0))
    assert one.slice_m(first, last)[:lip].max() == pytest.approx(0.0, abs=1e-9)


def test_a_fed_pile_stays_and_counts_what_came() -> None:
    one, columns = heap(fed=True), (18, 41)
    volume = one.volume_m3
    for _ in range(8):
        one.give_back(*columns, 0.5 * one.slice_m(*columns))
        taken = volume - one.volume_m3
        one.slide(20.0, 10.0)
        assert taken > 0.0
        volume = one.volume_m3
    assert one.came_m3 > 1.0


def test_scanners_see_the_heights() -> None:
    one = heap(rough_m=0.0)
    surface = Surface(one.mesh())
    x, y = np.meshgrid(TOE_M + np.linspace(0.5, 8.0, 20), np.linspace(-2.0, 2.0, 9))
    rays = np.zeros((x.size, 6), dtype=np.float32)
    rays[:, :3] = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 10.0)]) - surface.origin_m
    rays[:, 5] = -1.0
    seen = 10.0 - surface.cast(rays)
    assert seen == pytest.approx(one.height_at(np.column_stack([x.ravel(), y.ravel()])), abs=0.1)


def test_stones_are_seen_where_nothing_was_dug() -> None:
    one = heap(rough_m=0.1)
    assert np.std(one.stones_m[one.heights_m > 0.5]) == pytest.approx(0.1, rel=0.2)
    assert math.isclose(one.volume_m3, heap().volume_m3, rel_tol=0.02)
