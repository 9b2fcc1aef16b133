"""Skid factor by hand-calculated values."""

from __future__ import annotations

import math

import pytest
from lhdmap.proprioception.slip import SkidFactor, SlipSettings


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def test_skid_factor_of_equation_7_by_hand() -> None:
    slip = SkidFactor(SlipSettings(window_s=2.0, min_speed_mps=0.1))
    assert slip.update(ns(0.0), 2.0, 2.0) == pytest.approx(0.0)
    assert slip.update(ns(0.5), 2.0, 1.0) == pytest.approx((2.0 - 1.0) / 2.0)
    assert slip.update(ns(1.0), 1.0, 0.2) == pytest.approx((1.0 - 0.2) / 2.0)  # v_Mm still 2.0, of 0.5 s ago
    assert slip.update(ns(1.5), 0.5, 2.5) == pytest.approx((0.5 - 2.5) / 2.5)  # the lidar's speed is the largest
    assert slip.update(ns(4.0), 1.0, 0.4) == pytest.approx((1.0 - 0.4) / 1.0)  # all before have left the window


def test_standing_still_is_no_skid() -> None:
    slip = SkidFactor(SlipSettings())
    for k in range(200):
        assert slip.update(ns(0.02 * k), 0.0, 0.0) == 0.0
    assert (
        abs(slip.update(ns(4.0), 0.003, -0.002)) < 0.06
    )  # noise at a stand stays far from the paper's threshold of 0.2


def test_reversing_with_spinning_wheels_is_negative_as_printed() -> None:
    slip = SkidFactor(SlipSettings())
    assert slip.update(0, -2.0, -1.0) == pytest.approx(-0.5)


def test_a_missing_speed_gives_no_factor() -> None:
    slip = SkidFactor(SlipSettings())
    assert math.isnan(slip.update(0, math.nan, 1.0))
    assert math.isnan(slip.update(1, 1.0, math.nan))
    assert slip.update(ns(1.0), 1.0, 1.0) == 0.0
