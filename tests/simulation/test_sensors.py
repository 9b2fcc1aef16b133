"""Inclinometer, tachometer and joints against the motion that they measure."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.messages import FloatArray, Inclination, Joints, Pressure, Record, Tachometer
from lhdmap.simulation import sensors
from lhdmap.simulation.driving import Motion
from lhdmap.simulation.sections import InclinometerSettings, WheelSettings
from lhdmap.simulation.sensors import Clock
from lhdmap.simulation.world import DriftWorld

CLOCK = Clock(1_700_000_000_000_000_001)


def ramp(seconds: float = 60.0) -> Motion:
    """A drive at 2 m/s whose pitch grows by 0.01 rad/s and whose joint turns by 0.005 rad/s."""
    time_s = np.arange(int(seconds * 1000) + 1) / 1000.0
    table = np.zeros((len(time_s), 7))
    table[:, 4], table[:, 6] = 0.01 * time_s, 0.005 * time_s
    return Motion(table, 2.0 * time_s, np.full(len(time_s), 2.0))


def rng() -> np.random.Generator:
    return np.random.default_rng(8)


def pitches(records: list[Record]) -> FloatArray:
    return np.array([record.message.pitch_rad for record in records if isinstance(record.message, Inclination)])


def speeds(records: list[Record]) -> FloatArray:
    return np.array([record.message.speed_mps for record in records if isinstance(record.message, Tachometer)])


@pytest.mark.parametrize("kind", ["first_order", "delay"])
def test_the_inclinometer_lags_by_its_lag(kind: str) -> None:
    settings = InclinometerSettings(noise_deg=0.0, lag_s=0.1, lag_kind=kind)
    records = list(sensors.inclinations(settings, ramp(), CLOCK, rng()))
    time_s = np.array([(record.log_time_ns - CLOCK.start_ns) * 1e-9 for record in records])
    assert np.diff(time_s) == pytest.approx(0.01)
    late = time_s > 2.0
    assert pitches(records)[late] == pytest.approx(0.01 * (time_s[late] - 0.1), abs=2e-5)


def test_a_first_order_lag_answers_a_step_with_its_time_constant() -> None:
    angles = np.zeros((3000, 2))
    angles[1000:] = 1.0
    shown = sensors.lagging(angles, InclinometerSettings(lag_s=0.1), np.array([0.9, 1.1, 1.3, 2.9]))
    assert shown[:, 0] == pytest.approx([0.0, 1 - math.exp(-1), 1 - math.exp(-3), 1.0], abs=0.01)


def test_the_inclinometer_has_its_noise_and_bias() -> None:
    settings = InclinometerSettings(noise_deg=0.2, bias_pitch_deg=0.5, lag_s=0.0)
    records = list(sensors.inclinations(settings, ramp(), CLOCK, rng()))
    time_s = np.array([(record.log_time_ns - CLOCK.start_ns) * 1e-9 for record in records])
    error = np.degrees(pitches(records) - 0.01 * time_s)
    assert error.mean() == pytest.approx(0.5, abs=0.02)
    assert error.std() == pytest.approx(0.2, rel=0.05)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(0.0, abs=0.05)


def test_the_tachometer_errs_by_its_scale() -> None:
    settings = WheelSettings(scale_error=0.01, noise_mps=0.02)
    shown = speeds(list(sensors.tachometer_readings(settings, ramp(), CLOCK, rng())))
    assert abs(shown.mean() / 2.0 - 1.0) == pytest.approx(0.01, abs=0.0015)
    assert shown.std() == pytest.approx(0.02, rel=0.05)


def test_the_wheels_slip_in_bursts_of_two_seconds() -> None:
    settings = WheelSettings(slip=True, scale_error=0.0, noise_mps=0.0, slip_size=0.5)
    shown = speeds(list(sensors.tachometer_readings(settings, ramp(), CLOCK, rng())))
    slipping = shown > 2.5
    lengths = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], slipping, [0]]))))[::2] / settings.rate_hz
    assert len(lengths) >= 2
    assert lengths[:-1] == pytest.approx(2.0, abs=0.03)
    assert shown[slipping] == pytest.approx(3.0)
    assert shown[~slipping] == pytest.approx(2.0)


def test_the_joint_encoder_follows_the_joint() -> None:
    settings = WheelSettings(articulation_noise_deg=0.05)
    records = list(sensors.joint_readings(settings, ramp(), CLOCK, rng()))
    messages = [record.message for record in records if isinstance(record.message, Joints)]
    time_s = np.array([(message.stamp_ns - CLOCK.start_ns) * 1e-9 for message in messages])
    error = np.array([message.positions_rad["articulation"] for message in messages]) - 0.005 * time_s
    assert np.degrees(error.std()) == pytest.approx(0.05, rel=0.1)
    assert np.mean([message.velocities_rps["articulation"] for message in messages]) == pytest.approx(0.005, abs=2e-4)
    assert set(messages[0].positions_rad) == {"articulation", "boom_lift", "bucket_tilt"}


def test_climbing_takes_more_pressure_than_rolling_down(world: DriftWorld) -> None:
    def mean_bar(pitch_rad: float) -> float:
        motion = ramp(10.0)
        motion.table[:, 4] = pitch_rad
        records = sensors.pressure_readings(motion, CLOCK, rng())
        return float(np.mean([r.message.pressure_pa for r in records if isinstance(r.message, Pressure)])) / 1e5

    assert 300.0 > mean_bar(-0.1) > mean_bar(0.0) > mean_bar(0.1) > 20.0


def test_stamps_are_whole_nanoseconds_at_the_rate() -> None:
    stamps = CLOCK.stamps_ns(100.0, 30.0, offset_s=0.01)
    assert stamps.dtype == np.int64
    assert len(stamps) == 3000
    assert abs(int(stamps[-1]) - (CLOCK.start_ns + 10_000_000 + round(2999e9 / 30))) <= 1
    assert CLOCK.seconds(stamps)[0] == pytest.approx(0.01)


def test_dust_comes_and_goes_about_its_mean(world: DriftWorld) -> None:
    dusty = DriftWorld(replace(world.scenario, scanner=replace(world.scenario.scanner, dust_share=0.05)))
    share = dusty.dust(dusty.clock.stamps_ns(100.0, 25.0))
    assert share.mean() == pytest.approx(0.05, rel=0.05)
    assert share.min() >= 0.0
    assert share.max() > 0.08
