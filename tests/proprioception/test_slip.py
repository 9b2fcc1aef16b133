"""Skid factor by hand-calculated values, calibration of the tachometer, and slip bursts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.proprioception.slip import SlipEstimator, SlipSettings


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def test_skid_factor_of_equation_7_by_hand() -> None:
    slip = SlipEstimator(SlipSettings(window_s=2.0, min_speed_mps=0.1))
    assert slip.update(ns(0.0), 2.0, 2.0) == pytest.approx(0.0)
    assert slip.update(ns(0.5), 2.0, 1.0) == pytest.approx((2.0 - 1.0) / 2.0)
    assert slip.update(ns(1.0), 1.0, 0.2) == pytest.approx((1.0 - 0.2) / 2.0)  # v_Mm still 2.0, of 0.5 s ago
    assert slip.update(ns(1.5), 0.5, 2.5) == pytest.approx((0.5 - 2.5) / 2.5)  # the lidar's speed is the largest
    assert slip.update(ns(4.0), 1.0, 0.4) == pytest.approx((1.0 - 0.4) / 1.0)  # all before have left the window


def test_standing_still_is_no_skid() -> None:
    slip = SlipEstimator(SlipSettings())
    for k in range(200):
        assert slip.update(ns(0.02 * k), 0.0, 0.0) == 0.0
    assert (
        abs(slip.update(ns(4.0), 0.003, -0.002)) < 0.06
    )  # noise at a stand stays far from the paper's threshold of 0.2


def test_reversing_with_spinning_wheels_is_negative_as_printed() -> None:
    slip = SlipEstimator(SlipSettings())
    assert slip.update(0, -2.0, -1.0) == pytest.approx(-0.5)


def test_a_missing_speed_gives_no_factor() -> None:
    slip = SlipEstimator(SlipSettings())
    assert math.isnan(slip.update(0, math.nan, 1.0))
    assert math.isnan(slip.update(1, 1.0, math.nan))
    assert slip.update(ns(1.0), 1.0, 1.0) == 0.0


class Drive:
    """A drive of the machine with its true speed, a tachometer with a scale error and bursts of slip."""

    def __init__(self, scale_error: float = 1.01, lidar_std: float = 0.1, seed: int = 0) -> None:
        self.scale_error, self.lidar_std = scale_error, lidar_std
        self.rng = np.random.default_rng(seed)

    @staticmethod
    def truth(t: float) -> float:
        return 1.7 * min(t / 2.0, 1.0) + 0.2 * math.sin(t)

    def wheel(self, t: float, bursts: tuple[tuple[float, float], ...] = ()) -> float:
        spin = 1.4 if any(a <= t < b for a, b in bursts) else 1.0
        return self.truth(t) * self.scale_error * spin + self.rng.normal(0.0, 0.02)

    def lidar(self, t: float) -> float:
        return self.truth(t) + self.rng.normal(0.0, self.lidar_std)


@pytest.mark.parametrize("error", [1.01, 0.99, 1.05, 0.9])
def test_the_scale_of_the_tachometer_is_learnt_through_slip(error: float) -> None:
    drive, slip = Drive(error), SlipEstimator(SlipSettings())
    bursts = tuple((a, a + 2.0) for a in (1.0, 11.0, 21.0, 31.0, 41.0))
    for t in np.arange(0.0, 60.0, 0.02):
        slip.update(ns(t), drive.wheel(t, bursts), drive.lidar(t), drive.lidar_std)
    assert slip.scale * error == pytest.approx(1.0, abs=0.004)
    assert abs(slip.scale - 1.0 / error) < 4.0 * slip.scale_std


def test_a_burst_is_recognised_where_the_scanner_sees_the_motion() -> None:
    drive, slip = Drive(), SlipEstimator(SlipSettings())
    flags = []
    for t in np.arange(0.0, 30.0, 0.02):
        factor = slip.update(ns(t), drive.wheel(t, ((20.0, 22.0),)), drive.lidar(t), drive.lidar_std)
        flags.append((t, slip.trusted, factor))
    table = np.array(flags)
    during = (table[:, 0] >= 20.1) & (table[:, 0] < 22.0)
    assert not table[during, 1].any()
    assert np.median(table[during, 2]) == pytest.approx(0.4 / 1.4, abs=0.08)
    assert table[(table[:, 0] > 22.6) | (table[:, 0] < 20.0), 1].mean() > 0.995


def test_a_burst_is_recognised_by_inertia_alone() -> None:
    drive, slip = Drive(), SlipEstimator(SlipSettings())
    wrong = 0
    for t in np.arange(0.0, 40.0, 0.02):
        blind = t > 18.0
        wheel = drive.wheel(t, ((20.0, 22.0), (30.0, 32.0)))
        believed = slip.agrees(ns(t), wheel)
        slip.update(ns(t), wheel, math.nan if blind else drive.lidar(t), math.inf if blind else drive.lidar_std)
        slipping = 20.0 <= t < 22.0 or 30.0 <= t < 32.0
        recovering = 22.0 <= t < 22.6 or 32.0 <= t < 32.6
        wrong += int(believed == slipping and not recovering)
    assert wrong <= 10


def test_starting_and_braking_is_not_slip() -> None:
    slip = SlipEstimator(SlipSettings())
    rng = np.random.default_rng(5)
    trusted = []
    for t in np.arange(0.0, 20.0, 0.05):
        speed = float(np.interp(t, [0, 2, 5, 7, 10, 11, 15, 18, 20], [0, 0, 3.5, 3.5, 0, 0, -4, -4, 0]))
        slip.update(ns(t), speed + rng.normal(0, 0.02), math.nan, math.inf)
        trusted.append(slip.trusted)
    assert np.mean(trusted) > 0.99


def test_wheels_are_not_distrusted_for_ever_without_a_scanner() -> None:
    slip = SlipEstimator(SlipSettings(max_slip_s=3.0))
    for t in np.arange(0.0, 12.0, 0.02):
        slip.update(ns(t), 1.0 if t < 5.0 else 2.5, math.nan, math.inf)
        if 5.1 < t < 7.9:
            assert not slip.trusted
    assert slip.trusted
    assert slip.speed_mps == pytest.approx(2.5, abs=0.05)


def test_stamps_that_do_not_rise_change_nothing() -> None:
    slip = SlipEstimator(SlipSettings())
    slip.update(ns(1.0), 1.0, 1.0)
    before = (slip.speed_mps, slip.trusted, slip.scale)
    slip.update(ns(0.5), 9.0, 1.0)
    assert (slip.speed_mps, slip.trusted, slip.scale) == before
