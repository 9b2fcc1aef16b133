"""The time between scans, and which scans are processed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.odometry.clock import ScanClock
from lhdmap.odometry.rate import AdaptiveRate
from lhdmap.odometry.settings import OdometrySettings

START_NS = 1_758_000_000_000_000_000
PERIOD_NS = 40_000_000


def test_regular_stamps_are_taken_as_they_are() -> None:
    clock = ScanClock()
    stamps = START_NS + PERIOD_NS * np.cumsum(np.random.default_rng(0).choice([1, 1, 1, 2], 300))
    steps = np.array([clock.step(int(stamp)) for stamp in stamps])
    assert steps[0] == 0.0
    assert steps[1:] == pytest.approx(np.diff(stamps) * 1e-9, abs=1e-12)
    assert not clock.bunched


def test_bunched_stamps_give_a_steady_time() -> None:
    """Four scans delivered at once, 160 ms apart: the period is 40 ms all the same."""
    clock = ScanClock()
    stamps = [START_NS + (k // 4) * 4 * PERIOD_NS + (k % 4) * 100_000 for k in range(800)]
    steps = np.array([clock.step(stamp) for stamp in stamps])
    assert clock.bunched
    late = steps[400:]
    assert late.min() > 0.015
    assert late.max() < 0.08
    assert late.sum() == pytest.approx((stamps[-1] - stamps[399]) * 1e-9, abs=0.3)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(-200_000_000, 400_000_000), min_size=2, max_size=120))
def test_time_never_runs_backwards(gaps_ns: list[int]) -> None:
    clock, stamp = ScanClock(), START_NS
    for gap in gaps_ns:
        stamp += gap
        step = clock.step(stamp)
        assert np.isfinite(step)
        assert step >= 0.0


def test_stamps_made_rising_by_a_nanosecond_tell_no_time() -> None:
    """A log whose stamps ran backwards has them: the scans are a period apart all the same."""
    clock, stamps = ScanClock(), [START_NS + k * PERIOD_NS for k in range(100)]
    stamps += [stamps[-1] + 1, stamps[-1] + 2]
    assert [clock.step(stamp) for stamp in stamps][-2:] == pytest.approx([0.04, 0.04], rel=0.1)


def test_bunches_among_the_first_scans_are_known_from_the_first_step_on() -> None:
    """Of the Intel log's middle: three scans at once each 0.6 s; a speed from two of a bunch were a hundred times too large."""
    stamps = [START_NS + (k // 3) * 600_000_000 + (k % 3) * 1_000_000 for k in range(25)]
    clock = ScanClock()
    clock.expect(stamps)
    steps = [clock.step(stamp) for stamp in stamps]
    assert clock.bunched
    assert min(steps[1:]) > 0.08
    assert max(steps) < 0.45


@pytest.mark.parametrize("gaps", [(), (4,), (4, 15)])
def test_a_gap_or_two_among_the_first_scans_are_no_bunches(gaps: tuple[int, ...]) -> None:
    stamps = [START_NS + k * PERIOD_NS + sum(k > gap for gap in gaps) * 3_000_000_000 for k in range(25)]
    clock = ScanClock()
    clock.expect(stamps)
    assert [clock.step(stamp) for stamp in stamps][1:] == pytest.approx(np.diff(stamps) * 1e-9)
    assert not clock.bunched


def processed_m(speed_mps: float, rate_hz: float) -> float:
    """Return the mean distance between processed scans at constant speed."""
    rate = AdaptiveRate(OdometrySettings())
    velocity = np.array([speed_mps, 0.0, 0.0])
    due = [rate.due(1.0 / rate_hz, velocity) for _ in range(2000)]
    return speed_mps / rate_hz / float(np.mean(due[20:]))


@pytest.mark.parametrize("rate_hz", [25.0, 50.0, 100.0])
@pytest.mark.parametrize("speed_mps", [1.0, 1.7, 3.3, 6.7])
def test_the_distance_between_processed_scans_does_not_follow_the_speed(speed_mps: float, rate_hz: float) -> None:
    wanted_m, frame_m = OdometrySettings().step_m, speed_mps / rate_hz
    assert processed_m(speed_mps, rate_hz) == pytest.approx(max(wanted_m, frame_m) + 0.5 * frame_m, abs=0.51 * frame_m)


def test_first_scans_and_standstill_are_processed() -> None:
    settings_ = OdometrySettings()
    rate = AdaptiveRate(settings_)
    due = [rate.due(0.02, np.zeros(3)) for _ in range(500)]
    assert all(due[:5])
    assert np.mean(due[50:]) == pytest.approx(0.02 / settings_.step_s, rel=0.1)


def test_a_turn_counts_as_motion() -> None:
    rate = AdaptiveRate(OdometrySettings())
    due = [rate.due(0.02, np.array([0.0, 0.0, np.radians(30.0)])) for _ in range(500)]
    assert np.mean(due[50:]) == pytest.approx(0.5, abs=0.1)
