"""Slope, sum and force balance against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.loading.detector_force import Cusum, ForceResidual, LineSlope

from tests.loading.digging.test_skid import heard


def test_slope_of_a_line() -> None:
    slope = LineSlope(0.3)
    found = [slope.update(k * 20_000_000, 3.0 - 0.7 * 0.02 * k) for k in range(40)]
    assert found[:2] == [0.0, 0.0]
    np.testing.assert_allclose(found[2:], -0.7, atol=1e-9)


def test_slope_leaves_out_what_is_no_number() -> None:
    slope = LineSlope(0.3)
    for k in range(40):
        value = slope.update(k * 20_000_000, math.nan if k % 3 == 0 else 0.5 * 0.02 * k)
    assert value == pytest.approx(0.5)


def test_a_step_is_told_after_the_limit_over_its_height() -> None:
    """S grows by (x - free) dt: 50 over 20 reaches 3 after 0.1 s; it left zero when the step came."""
    cusum = Cusum(free=20.0, limit=3.0)
    told = [k for k in range(400) if cusum.update(10_000_000 * (k + 1), 50.0 if k >= 100 else 5.0)]
    assert 0.0 <= (told[0] - 100) * 0.01 - 0.1 <= 0.02
    assert cusum.since_ns == 10_000_000 * 101


def test_below_free_nothing_is_summed_and_a_break_starts_anew() -> None:
    cusum = Cusum(20.0, 3.0)
    for k in range(1000):
        assert not cusum.update(10_000_000 * (k + 1), 19.9)
    assert cusum.sum == 0.0
    cusum.update(20_000_000_000, math.nan)
    assert cusum.sum == 0.0


def test_rolling_and_speeding_up_leave_no_force() -> None:
    """k p = m a + R exactly: nothing is pushed against."""
    force = ForceResidual(kn_per_bar=0.4, mass_t=34.0, rolling_kn=10.0, slope_s=0.3)
    for tick in range(60):
        one = heard(tick, 0.5 * 0.02 * tick, 0.0)._replace(transmission_bar=(34.0 * 0.5 + 10.0) / 0.4)
        value = force.update(one)
    assert value == pytest.approx(0.0, abs=1e-9)


def test_a_machine_that_is_braked_by_the_pile_shows_the_force_of_that() -> None:
    force = ForceResidual(0.4, 34.0, 10.0, 0.3)
    for tick in range(60):
        value = force.update(heard(tick, 2.0 - 1.0 * 0.02 * tick, 0.0)._replace(transmission_bar=25.0))
    assert value == pytest.approx(34.0)
