"""Eqs. (2) to (6): when a target is reached, and when it was missed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.navigation.goals import Approach, likelihood_pm2, overrun, reached
from lhdmap.navigation.settings import NavigationSettings

SETTINGS = NavigationSettings()


def approach(off_m: float, closing_mps: float = 1.0, heading_deg: float = 0.0, std_m: float = 0.1) -> Approach:
    return Approach(np.array([off_m, 0.0]), np.eye(2) * std_m**2, closing_mps, math.radians(heading_deg))


def test_the_likelihood_is_that_of_a_normal_distribution() -> None:
    at = likelihood_pm2(approach(0.0, std_m=0.6), 0.8)
    assert at == pytest.approx(1.0 / (2.0 * math.pi * 1.0))  # 0.6² + 0.8² = 1
    assert likelihood_pm2(approach(2.0, std_m=0.6), 0.8) == pytest.approx(at * math.exp(-2.0))


def test_in_a_tunnel_the_place_alone_counts_in_an_intersection_course_and_speed_too() -> None:
    away = approach(0.5, closing_mps=-1.0, heading_deg=90.0)
    assert reached(away, SETTINGS, crossing=False)
    assert not reached(away, SETTINGS, crossing=True)
    assert not reached(approach(0.5, closing_mps=0.0), SETTINGS, crossing=True)  # Eq. (3)
    assert not reached(approach(0.5, heading_deg=30.0), SETTINGS, crossing=True)  # Eq. (4)
    assert not reached(approach(0.5, heading_deg=-330.0 + 55.0), SETTINGS, crossing=True)
    assert reached(approach(0.5, heading_deg=360.0 - 20.0), SETTINGS, crossing=True)
    assert not reached(approach(5.0), SETTINGS, crossing=False)


@given(st.floats(0.0, 6.0), st.floats(0.01, 0.5), st.floats(0.0, 2.0 * math.pi))
def test_nearer_is_never_less_reached(off_m: float, std_m: float, angle: float) -> None:
    way = np.array([math.cos(angle), math.sin(angle)])
    far, near = (Approach(k * off_m * way, np.eye(2) * std_m**2, 1.0, 0.0) for k in (1.0, 0.5))
    assert reached(near, SETTINGS, crossing=True) or not reached(far, SETTINGS, crossing=True)


@pytest.mark.parametrize(
    ("driven_m", "length_m", "missed"),
    [(24.0, 20.0, False), (26.0, 20.0, True), (106.0, 100.0, False), (111.0, 100.0, True), (4.0, 0.1, False)],
)
def test_overrun_wants_both_a_way_and_a_share(driven_m: float, length_m: float, *, missed: bool) -> None:
    assert overrun(driven_m, length_m, SETTINGS) == missed
