"""ICP against shapes whose pose is known."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry import se2
from lhdmap.landmarks.icp import align, best_of, fit
from lhdmap.landmarks.target import IcpModel, prepare
from lhdmap.messages import FloatArray

MODEL = IcpModel()


def line(a: tuple[float, float], b: tuple[float, float], step_m: float = 0.1) -> FloatArray:
    n = round(math.dist(a, b) / step_m) + 1
    return np.linspace(a, b, n)


def room() -> FloatArray:
    """A room with one oblique wall: no two poses are alike."""
    corners = [(-4.0, -2.0), (5.0, -2.5), (5.0, 1.0), (2.0, 3.0), (-4.0, 2.0), (-4.0, -2.0)]
    return np.concatenate([line(a, b) for a, b in itertools.pairwise(corners)])


def corridor(length_m: float = 16.0) -> FloatArray:
    half = 0.5 * length_m
    return np.concatenate([line((-half, 2.0), (half, 2.0)), line((-half, -2.0), (half, -2.0))])


def off(found: FloatArray, true: FloatArray) -> tuple[float, float]:
    apart = se2.between(true, found)
    return float(np.hypot(apart[0], apart[1])), abs(math.degrees(apart[2]))


@given(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.floats(-0.15, 0.15))
@settings(max_examples=30, deadline=None)
def test_a_room_is_found_from_any_near_start(x: float, y: float, turn: float) -> None:
    true = np.array([x, y, turn])
    source = se2.transform(se2.inverse(true), room())
    found = align(prepare(room(), MODEL), source, np.zeros(3), MODEL)
    away_m, turned_deg = off(found.pose, true)
    assert away_m < 0.005
    assert turned_deg < 0.05
    assert found.valid
    assert found.fitness < 0.015**2  # corners: a line through points on two walls


@given(st.floats(-3.0, 3.0), st.floats(-20.0, 20.0))
@settings(max_examples=15, deadline=None)
def test_where_the_clouds_lie_does_not_matter(turn: float, x: float) -> None:
    """Both clouds moved alike: the pose between them moves with them."""
    moved = np.array([x, -x / 3.0, turn])
    model = IcpModel(range_m=100.0)
    source = room() + np.array([0.15, 0.05])
    plain = align(prepare(room(), model), source, np.zeros(3), model).pose
    target, carried = se2.transform(moved, room()), se2.transform(moved, source)
    found = align(prepare(target, model), carried, np.zeros(3), model).pose
    expected = se2.compose(se2.compose(moved, plain), se2.inverse(moved))
    assert off(se2.compose(found, moved), se2.compose(expected, moved))[0] < 0.02


def test_points_alone_find_it_too_when_they_start_right() -> None:
    model = IcpModel(to_line=False)
    found = align(prepare(room(), model), room(), np.array([0.03, 0.02, 0.0]), model)
    assert off(found.pose, np.zeros(3))[0] < 0.02


def test_the_fitness_is_the_mean_square_of_the_distances() -> None:
    """Walls 4 m apart against walls 4.2 m apart: each point is 10 cm from its wall."""
    target, source = corridor(), corridor() * np.array([1.0, 2.1 / 2.0])
    assert fit(target.astype(np.float32), source.astype(np.float32), np.zeros(3), MODEL).fitness == pytest.approx(
        0.01, rel=0.05
    )


def test_the_fitness_is_truncated() -> None:
    target, source = corridor(), corridor() * np.array([1.0, 1.2])
    assert align(prepare(target, MODEL), source, np.zeros(3), MODEL).fitness == pytest.approx(0.15**2, rel=0.05)


def test_a_corridor_holds_across_and_not_along() -> None:
    information = align(prepare(corridor(), MODEL), corridor(), np.zeros(3), MODEL).information
    assert information[1, 1] > 1000.0 * max(information[0, 0], 1.0)


def test_the_share_in_common_is_what_both_could_see() -> None:
    """Two corridors of 16 m, 8 m apart: half of one is within 10 m of the other and where it has walls."""
    found = align(prepare(corridor(), MODEL), corridor(), np.array([8.0, 0.0, 0.0]), MODEL)
    assert found.share == pytest.approx(0.5, abs=0.13)
    assert not found.valid
    assert found.fitness == MODEL.limit_m**2


def test_one_wall_is_not_enough() -> None:
    left = corridor()[: len(corridor()) // 2]
    found = align(prepare(left, MODEL), corridor(), np.zeros(3), MODEL._replace(min_share=0.45))
    assert not found.valid


def test_the_best_start_wins() -> None:
    starts = np.array([[-3.0, 0.0, 0.0], [0.3, 0.0, 0.0], [3.0, 0.0, 0.0]])
    found = best_of(prepare(room(), MODEL), room(), starts, MODEL)
    assert off(found.pose, np.zeros(3))[0] < 0.01


@pytest.mark.parametrize("points", [np.array([[3.0, 1.0]]), np.array([[3.0, 1.0], [3.0, 1.0]]), np.zeros((0, 2))])
def test_hardly_any_points_are_no_match_and_no_crash(points: FloatArray) -> None:
    found = align(prepare(room(), MODEL), points, np.zeros(3), MODEL)
    assert np.isfinite(found.pose).all()
    few = align(prepare(np.array([[3.0, 1.0]]), MODEL), room(), np.zeros(3), MODEL)
    assert not few.valid
