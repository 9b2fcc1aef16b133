"""Paths, projections and circles: against closed forms of lines, arcs and clothoids."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.tracking.circles import circle_beside, three_points
from lhdmap.tracking.path import beside, nearest, path_of

from tests.tracking.paths import bend, exact, straight

LINE = exact(
    np.concatenate([straight(20.0), bend(12.0, 90.0, 8.0), straight(10.0), bend(15.0, -60.0, 8.0), straight(20.0)])
)
beside(LINE, 0.0, 0.0, 0.0, 1.0, 1.0)


def arc(radius: float, turn: float, step: float = 0.1) -> FloatArray:
    """Rows of an arc from the origin along x."""
    rows: FloatArray = exact(np.full(round(abs(turn * radius) / 0.01), math.copysign(1.0 / radius, turn)))
    return rows


@given(st.floats(6.0, 100.0), st.sampled_from([1, -1]), st.floats(0.1, 0.9), st.floats(-3.0, 3.0))
def test_a_projection_on_an_arc_is_exact(radius: float, side: int, share: float, aside: float) -> None:
    rows = arc(radius, side * 1.2)
    angle = share * 1.2
    r = radius - side * aside
    x, y = r * math.sin(angle), side * (radius - r * math.cos(angle))
    along, offset, heading, curvature = beside(rows, x, y, angle * radius, 4.0, 4.0)
    assert offset == pytest.approx(aside, abs=1e-3)
    assert along == pytest.approx(angle * radius, abs=5e-3)
    assert heading == pytest.approx(side * angle, abs=1e-3)
    assert curvature == pytest.approx(side / radius)


@given(st.floats(1.0, 60.0), st.floats(-3.0, 3.0))
def test_a_projection_gives_back_the_place(along: float, aside: float) -> None:
    row = LINE[round(along * 10)]
    x, y = row[0] - aside * math.sin(row[2]), row[1] + aside * math.cos(row[2])
    s, z, heading, _ = beside(LINE, x, y, along + 1.0, 3.0, 3.0)
    assert (s, z, heading) == pytest.approx((round(along * 10) * 0.1, aside, row[2]), abs=1e-3)


def test_the_nearest_place_has_the_heading() -> None:
    """A way that is driven out and back is beside itself."""
    there = exact(np.concatenate([straight(20.0), bend(2.0, 180.0, 0.0), straight(20.0)]))
    assert nearest(there, 10.0, 2.0, 0.0) < 20.0
    assert nearest(there, 10.0, 2.0, math.pi) > 26.0


@pytest.mark.parametrize("each", [2, 10, 20])
def test_a_path_goes_through_its_waypoints(each: int) -> None:
    path = path_of(LINE[::each, :2], 0.8, 5.0)
    off = [
        beside(path.points, x, y, path.begin_m + s, 2.0, 2.0)[1]
        for s, (x, y) in zip(np.arange(len(LINE)) * 0.1, LINE[:, :2], strict=True)
    ]
    assert np.abs(off).max() < 0.003
    assert path.end_m - path.begin_m == pytest.approx((len(LINE) - 1) // each * each * 0.1, abs=0.1)
    inner = path.points[round(path.begin_m * 10) : round(path.end_m * 10)]
    known = np.interp(np.arange(len(inner)) * 0.1, np.arange(len(LINE)) * 0.1, LINE[:, 3])
    assert np.sqrt(np.mean((inner[:, 3] - known) ** 2)) < 0.002


def test_noise_of_waypoints_does_not_become_curvature() -> None:
    """Three neighbours 0.1 m apart would give 5 1/m."""
    rng = np.random.default_rng(2)
    path = path_of(LINE[:, :2] + 0.02 * rng.standard_normal((len(LINE), 2)), 0.8, 5.0)
    inner = path.points[round(path.begin_m * 10) + 20 : round(path.end_m * 10) - 20]
    known = np.interp(np.arange(len(inner)) * 0.1 + 2.0, np.arange(len(LINE)) * 0.1, LINE[:, 3])
    assert np.sqrt(np.mean((inner[:, 3] - known) ** 2)) < 0.01
    off = [
        beside(LINE, x, y, s + 2.0, 3.0, 3.0)[1]
        for s, (x, y) in zip(np.arange(len(inner)) * 0.1, inner[:, :2], strict=True)
    ]
    assert np.sqrt(np.mean(np.square(off))) < 0.008


def test_uneven_and_doubled_waypoints_are_no_matter() -> None:
    chosen = np.unique(np.cumsum(np.random.default_rng(1).choice([1, 4, 9, 20], 400)).clip(0, len(LINE) - 1))
    path = path_of(LINE[np.repeat(chosen, 2), :2], 0.8, 5.0)
    off = [
        beside(LINE, x, y, s, 4.0, 4.0)[1]
        for s, (x, y) in zip(np.arange(400) * 0.1, path.points[50:450, :2], strict=True)
    ]
    assert np.abs(off).max() < 0.03


@pytest.mark.parametrize("bad", [np.zeros((5, 2)), np.zeros((1, 2)), np.full((9, 2), math.nan), np.zeros((4, 5))])
def test_what_is_no_path_is_refused(bad: FloatArray) -> None:
    with pytest.raises(InputError, match="path"):
        path_of(bad, 0.8, 5.0)


@given(st.floats(5.0, 200.0), st.sampled_from([1, -1]), st.floats(-2.0, 2.0), st.floats(0.05, 0.5))
def test_a_circle_through_three_points_is_that_circle(radius: float, side: int, aside: float, angle: float) -> None:
    angles = np.array([0.0, 3.0 / radius, 6.5 / radius])
    three = np.column_stack([radius * np.sin(angles), side * radius * (1.0 - np.cos(angles))])
    r = radius - side * aside
    found = circle_beside(three, r * math.sin(angle), side * (radius - r * math.cos(angle)))
    assert found.curvature_pm == pytest.approx(side / radius, rel=1e-6)
    assert found.offset_m == pytest.approx(aside, abs=1e-6)
    assert math.remainder(found.heading_rad - side * angle, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


def test_three_points_on_a_line_are_a_line() -> None:
    found = circle_beside(np.array([[0.0, 0.0], [3.0, 3.0], [6.0, 6.0]]), 1.0, 2.0)
    assert found == pytest.approx((math.sqrt(0.5), math.pi / 4, 0.0))


@pytest.mark.parametrize("x", [-3.0, 4.2, 19.5, 30.0])
def test_points_of_a_look_ahead_are_so_far_apart(x: float) -> None:
    """At the end of the path, too, which the paper leaves open."""
    line = np.column_stack([np.arange(0.0, 20.1, 0.5), np.zeros(41)])
    three, closest = three_points(line, x, 0.3, 3.0, 20)
    assert np.diff(three[:, 0]).min() >= 3.0
    assert line[closest, 0] == pytest.approx(min(max(x, 0.0), 20.0), abs=0.26)


def test_look_ahead_of_v_ts_makes_the_sign_of_a_bend_a_coin_toss() -> None:
    """Errata: the fitted curvature's deviation is √6 σ / h², σ 2 cm; 0.07 m (5 km/h) or 3 m."""
    rng, spread = np.random.default_rng(0), {}
    for apart in (0.07, 3.0):
        line = arc(20.0, 0.5)
        s = np.array([0.0, apart, 2.0 * apart])
        three = np.column_stack([np.interp(s, np.arange(len(line)) * 0.1, line[:, k]) for k in range(2)])
        found = [circle_beside(three + 0.02 * rng.standard_normal((3, 2)), 0.0, 0.0).curvature_pm for _ in range(300)]
        spread[apart] = float(np.std(found))
    assert spread[3.0] == pytest.approx(math.sqrt(6.0) * 0.02 / 3.0**2, rel=0.15)
    assert spread[0.07] > 100.0 * spread[3.0]
