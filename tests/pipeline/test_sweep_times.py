"""A time increment that cannot be is not used; one that can be is left."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.messages import LaserScan
from lhdmap.pipeline.sweep_times import SweepTimes


def _checked(increment_s: float, period_s: float = 0.04, beams: int = 381) -> tuple[list[float], SweepTimes]:
    times = SweepTimes()
    ranges = np.full(beams, 5.0, np.float32)
    scans = [LaserScan(round(k * period_s * 1e9), "s", -1.0, 0.01, increment_s, 0.1, 30.0, ranges) for k in range(30)]
    return [times.checked("front", scan).time_increment_s for scan in scans], times


@pytest.mark.parametrize("increment_s", [0.0, 0.04 / 381, 0.02 / 381, -0.04 / 381])
def test_a_sweep_within_the_period_is_left(increment_s: float) -> None:
    got, times = _checked(increment_s)
    assert got == [increment_s] * 30
    assert times.warnings == []


def test_the_time_of_a_scan_given_for_that_of_a_beam_is_not_used() -> None:
    """A driver's usual fault: sweeps of 15 s, and a drive of 40 m became one of 184 m."""
    got, times = _checked(0.04)
    assert got == [0.0] * 30
    assert "a sweep lasts 15.2 s" in times.warnings[0]


def test_a_sweep_that_is_too_long_for_its_rate_is_found_out_soon() -> None:
    got, _ = _checked(0.12 / 381)
    assert got[10:] == [0.0] * 20


def test_bunched_scans_do_not_make_a_sweep_too_long() -> None:
    times = SweepTimes()
    ranges = np.full(381, 5.0, np.float32)
    for k in range(60):
        first, place = divmod(k, 6)
        scan = LaserScan(round((0.24 * first + 0.001 * place) * 1e9), "s", -1.0, 0.01, 1e-4, 0.1, 30.0, ranges)
        assert times.checked("front", scan).time_increment_s == 1e-4
