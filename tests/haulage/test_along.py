"""The end of an edge is crossed, not come near to: the findings' miss at 30 km/h, and paths that come back over themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.haulage.along import Along

STRAIGHT = np.array([[float(x), 0.0] for x in range(31)])


@given(st.floats(-0.42, 0.0), st.floats(-3.0, 3.0), st.floats(0.05, 2.0))
def test_an_end_is_crossed_at_any_speed_offset_and_phase(phase_m: float, lateral_m: float, step_m: float) -> None:
    along = Along(STRAIGHT)
    x = phase_m
    while x < 40.0 and not along.ended:
        assert x < 30.0
        x += step_m
        along.moved(x, lateral_m)
    assert along.ended
    assert 30.0 <= x < 30.0 + step_m + 1e-9


def test_a_circle_of_half_a_metre_is_missed_by_the_same_drive() -> None:
    """The chord at 0.46 m beside is 0.39 m long, a tick at 30 km/h 0.42 m."""
    ticks = np.arange(0.21, 60.0, 30.0 / 3.6 * 0.05)
    near = np.hypot(ticks - 30.0, 0.46).min()
    chord_m = 2.0 * math.sqrt(0.5**2 - 0.46**2)
    assert chord_m == pytest.approx(0.392, abs=0.001)
    assert any(np.hypot(ticks + shift - 30.0, 0.46).min() > 0.5 for shift in np.arange(0.0, 0.42, 0.01))
    assert near > 0.0


def test_a_machine_that_others_moved_along_its_edge_is_found_again() -> None:
    along = Along(np.array([[float(x), 0.0] for x in range(301)]))
    along.moved(5.0, 0.0)
    assert along.moved(250.0, 0.3) == pytest.approx(250.0)


def test_a_way_that_comes_near_itself_is_followed_in_order() -> None:
    angles = np.linspace(0.0, 1.9 * math.pi, 200)
    loop = 20.0 * np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    along = Along(loop)
    s = [along.moved(*point) for point in loop]
    assert np.all(np.diff(s) > 0.0)
    assert along.ended


def test_what_is_not_finite_changes_nothing() -> None:
    along = Along(STRAIGHT)
    along.moved(5.0, 0.0)
    assert along.moved(math.nan, 0.0) == along.moved(0.0, math.inf) == 5.0


def test_who_begins_beyond_the_end_has_crossed_it() -> None:
    along = Along(STRAIGHT[:3])
    along.moved(2.5, 0.1)
    assert along.ended
