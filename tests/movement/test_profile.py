"""Times along a route, against simple cases by hand and a simulation in small steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.movement.costs import connection_times, pace_of
from lhdmap.movement.profile import run_times
from lhdmap.movement.settings import MovementSettings

from tests.movement.mines import with_connection
from tests.topology.maps import ladder

PACE = pace_of(MovementSettings(acceleration_mps2=0.5, deceleration_mps2=0.8))


def test_a_long_run_is_a_trapezoid() -> None:
    """5 m/s: 10 s and 25 m to gather, 6.25 s and 15.625 m to lose."""
    assert run_times([100.0], [5.0], PACE) == [pytest.approx(10.0 + 6.25 + (100.0 - 25.0 - 15.625) / 5.0)]


def test_a_short_run_is_a_triangle() -> None:
    """Its peak p satisfies p² / 2a + p² / 2d = length; the time is p / a + p / d."""
    length = 8.0
    peak = math.sqrt(2.0 * length * 0.5 * 0.8 / (0.5 + 0.8))
    assert peak < 5.0
    assert run_times([length], [5.0], PACE) == [pytest.approx(peak / 0.5 + peak / 0.8)]


def test_pieces_of_a_run_sum_to_the_whole() -> None:
    cut = run_times([2.0, 0.0, 3.0, 20.0, 1.0, 14.0], [4.0] * 6, PACE)
    assert sum(cut) == pytest.approx(run_times([40.0], [4.0], PACE)[0])
    assert cut[1] == 0.0


def test_a_point_is_passed_at_its_limit() -> None:
    """As a piece of no length with that limit."""
    capped = run_times([30.0, 30.0], [4.0, 5.0], PACE, [1.5])
    assert sum(capped) == pytest.approx(sum(run_times([30.0, 0.0, 30.0], [4.0, 1.5, 5.0], PACE)))
    assert sum(capped) == pytest.approx(simulated([29.999, 0.004, 29.999], [4.0, 1.5, 5.0]), rel=0.002)


def simulated(lengths: list[float], speeds: list[float]) -> float:
    """Return the time of the quickest drive in steps of 2 mm: the highest speed squared at each place, from both sides."""
    step = 0.002
    ends = np.cumsum(lengths)
    at = np.arange(0.0, ends[-1] + step, step)
    limit = np.array(speeds)[np.minimum(np.searchsorted(ends, at[:-1] + step / 2.0), len(speeds) - 1)]
    squares = np.zeros(len(at))
    squares[1:-1] = np.minimum(limit[:-1], limit[1:]) ** 2
    for k in range(1, len(at)):
        squares[k] = min(squares[k], squares[k - 1] + 2.0 * PACE.acceleration_mps2 * step)
    for k in range(len(at) - 2, -1, -1):
        squares[k] = min(squares[k], squares[k + 1] + 2.0 * PACE.deceleration_mps2 * step)
    speed = np.sqrt(squares)
    return float((2.0 * step / (speed[1:] + speed[:-1])).sum())


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.floats(0.5, 12.0), st.floats(1.0, 6.0)), min_size=1, max_size=5))
def test_times_are_those_of_a_simulation(pieces: list[tuple[float, float]]) -> None:
    lengths, speeds = [round(length, 2) for length, _ in pieces], [speed for _, speed in pieces]
    assert sum(run_times(lengths, speeds, PACE)) == pytest.approx(simulated(lengths, speeds), rel=0.01)


def test_a_connection_costs_its_length_at_the_least_limit() -> None:
    topology = with_connection(ladder(), "i1.t1", "i1.t2", speed_limit_kmh=36.0)
    topology = replace(
        topology,
        tunnels=tuple(replace(one, speed_limit_kmh=6.0) if one.id == "t1" else one for one in topology.tunnels),
    )
    times = connection_times(topology, MovementSettings(limit_empty_kmh=24.0))
    assert times["t1.start", "t1.end"] == pytest.approx(48.0 / (6.0 / 3.6))
    assert times["t2.start", "t2.end"] == pytest.approx(108.0 / (12.0 / 3.6))
    assert times["i1.t1", "i1.t2"] == pytest.approx(math.hypot(6.0, 6.0) / (24.0 / 3.6))
    assert set(times) == {(one.start, one.end) for one in topology.connections}
