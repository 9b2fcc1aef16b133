"""Eq. (7): windows, floor, lag."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.loading.signals import Signals
from lhdmap.loading.skid import SkidFactor

_TICK_NS = 20_000_000


def heard(tick: int, wheels: float, scan: float, lag_ticks: int = 0) -> Signals:
    """Return signals of a tick."""
    now_ns = 1_000_000_000 + tick * _TICK_NS
    return Signals(now_ns, wheels, scan, now_ns - lag_ticks * _TICK_NS, *[0.0] * 7)


def test_the_speeds_over_the_largest_of_the_window() -> None:
    skid = SkidFactor(window_s=1.0, floor_mps=0.2)
    assert skid.update(heard(0, 2.0, 2.0)) == 0.0
    assert skid.update(heard(25, 1.0, 0.5)) == pytest.approx(0.5 / 2.0)
    assert skid.update(heard(50, 1.0, 0.5)) == pytest.approx(0.5 / 2.0)
    assert skid.update(heard(51, 1.0, 0.5)) == pytest.approx(0.5 / 1.0)  # 2 m/s has left the window


def test_slow_speeds_are_over_the_floor() -> None:
    assert SkidFactor(1.0, 0.2).update(heard(0, 0.05, 0.0)) == pytest.approx(0.25)


def test_a_scan_that_is_not_there_gives_nothing() -> None:
    skid = SkidFactor(1.0, 0.2)
    assert math.isnan(skid.update(heard(0, 1.0, math.nan)))
    assert math.isnan(skid.update(heard(1, math.nan, 1.0)))
    assert skid.update(heard(2, 1.0, 0.5)) == pytest.approx(0.5)


def test_at_a_launch_the_printed_factor_shows_the_lag_and_the_matched_one_nothing() -> None:
    """Without any slip, at 1 m/s², scans 0.1 s late: Eq. (7) shows 0.1 s * 1 m/s² over the speed."""
    printed, matched = SkidFactor(1.0, 0.01), SkidFactor(1.0, 0.01, lag_matched=True)
    for tick in range(100):
        speed = 0.02 * tick
        scan = max(speed - 0.1, 0.0)
        one = heard(tick, speed, scan, lag_ticks=5)
        late, level = printed.update(one), matched.update(one)
        if tick >= 10:
            assert late == pytest.approx(0.1 / speed)
            assert level == pytest.approx(0.0, abs=1e-12)


def test_matched_between_two_samples() -> None:
    skid = SkidFactor(1.0, 0.2, lag_matched=True)
    skid.update(heard(0, 1.0, 1.0))
    now = heard(1, 2.0, 1.5)
    assert skid.update(now._replace(scan_ns=now.now_ns - _TICK_NS // 2)) == pytest.approx(0.0)
    assert skid.wheels_mps == pytest.approx(1.5)


@given(st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0)), min_size=1, max_size=120))
def test_it_is_never_beyond_one_driving_forward(speeds: list[tuple[float, float]]) -> None:
    skid = SkidFactor(0.5, 0.2)
    for tick, (wheels, scan) in enumerate(speeds):
        value = skid.update(heard(tick, wheels, scan))
        assert abs(value) <= 1.0
        assert (value > 0.0) == (wheels > scan)
