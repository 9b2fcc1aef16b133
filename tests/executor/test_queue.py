"""The queue: override in time, interpolation, and what is no plan."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.driving.motion import Setpoint
from lhdmap.executor.queue import CommandQueue

MS = 1_000_000


def queue(*points: tuple[int, float, float]) -> CommandQueue:
    made = CommandQueue()
    made.insert([Setpoint(at * MS, speed, rate) for at, speed, rate in points])
    return made


def test_values_are_interpolated_and_nothing_is_planned_outside() -> None:
    one = queue((100, 1.0, 0.0), (200, 2.0, 0.2))
    assert one.at(99 * MS) is None
    assert one.at(201 * MS) is None
    now = one.at(150 * MS)
    assert now is not None
    assert now == pytest.approx((150 * MS, 1.5, 0.1))
    assert one.at(200 * MS) == Setpoint(200 * MS, 2.0, 0.2)
    assert one.slope_mps2(150 * MS) == pytest.approx(10.0)
    assert one.left_s(150 * MS) == pytest.approx(0.05)
    assert one.left_s(300 * MS) == 0.0


def test_a_plan_overrides_from_its_first_setpoint_on() -> None:
    one = queue((0, 1.0, 0.0), (100, 1.0, 0.0), (200, 1.0, 0.0), (300, 9.0, 0.0))
    one.insert([Setpoint(150 * MS, 2.0, 0.1), Setpoint(250 * MS, 2.0, 0.1)])
    before, between, after = one.at(100 * MS), one.at(125 * MS), one.at(250 * MS)
    assert before is not None
    assert between is not None
    assert after is not None
    assert before.speed_mps == 1.0
    assert between.speed_mps == pytest.approx(1.5)
    assert after.speed_mps == 2.0
    assert one.at(251 * MS) is None


def test_the_past_is_dropped_but_for_what_is_interpolated_from() -> None:
    one = queue(*((k * 100, float(k), 0.0) for k in range(10)))
    one.forget(450 * MS)
    assert len(one) == 6
    now = one.at(450 * MS)
    assert now is not None
    assert now.speed_mps == pytest.approx(4.5)


def test_the_way_until_a_planned_rest() -> None:
    one = queue((0, 2.0, 0.0), (1000, 2.0, 0.0), (2000, 0.0, 0.0), (3000, 0.0, 0.0), (4000, 1.0, 0.0))
    assert one.rest_m(0) == pytest.approx(3.0)
    assert one.rest_m(1500 * MS) == pytest.approx(0.25)
    assert one.rest_m(2500 * MS) == 0.0
    assert one.rest_m(3500 * MS) == math.inf
    assert one.rest_m(9000 * MS) == 0.0
    assert queue((0, -2.0, 0.0), (1000, 0.0, 0.0)).rest_m(0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "wrong",
    [
        [Setpoint(1, math.nan, 0.0)],
        [Setpoint(1, 0.0, math.inf)],
        [Setpoint(2, 0.0, 0.0), Setpoint(1, 0.0, 0.0)],
        [Setpoint(1, 0.0, 0.0), Setpoint(1, 0.0, 0.0)],
    ],
)
def test_what_is_no_plan_changes_nothing(wrong: list[Setpoint]) -> None:
    one = queue((100, 1.0, 0.0), (200, 2.0, 0.0))
    with pytest.raises(ValueError, match="setpoint"):
        one.insert(wrong)
    assert one.left_s(0) == pytest.approx(0.2)


PLANS = st.lists(
    st.tuples(st.integers(0, 40), st.lists(st.integers(1, 8), min_size=1, max_size=6), st.floats(-5.0, 5.0)), max_size=6
)


@given(PLANS, st.integers(0, 100))
def test_the_queue_says_what_the_last_plan_said(plans: list[tuple[int, list[int], float]], now: int) -> None:
    one, told = CommandQueue(), None
    for start, gaps, speed in plans:
        times = [start + sum(gaps[:k]) for k in range(len(gaps) + 1)]
        one.insert([Setpoint(at, speed, -speed) for at in times])
        told = times, speed
    one.forget(now)
    times_left = [point.at_ns for point in one._points]
    assert times_left == sorted(set(times_left))
    if told is not None and told[0][0] <= now <= told[0][-1]:
        found = one.at(now)
        assert found is not None
        assert found.speed_mps == pytest.approx(told[1])
    if told is not None and now > told[0][-1]:
        assert one.at(now) is None
