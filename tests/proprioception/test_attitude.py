"""The attitude filter against known attitudes: noise, lag, gaps, outliers, mounting."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray, Inclination
from lhdmap.proprioception.attitude import AttitudeFilter, AttitudeSettings
from lhdmap.proprioception.local_fit import fit_at
from scipy.signal import lfilter

LAG_S = 0.1


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def ramp_and_waves(t: FloatArray | float, speed_kmh: float = 12.0) -> FloatArray:
    """Pitch (rad) of a machine that drives over a floor with waves of 2.5 to 25 m length."""
    path = np.asarray(t) * speed_kmh / 3.6
    waves = ((25.0, 1.2), (9.0, 0.6), (4.0, 0.35), (2.5, 0.15))
    return np.deg2rad(sum(a * np.sin(2 * np.pi * path / length + length) for length, a in waves))


def inclination(t: float, roll: float, pitch: float) -> Inclination:
    return Inclination(ns(t), "inclinometer", float(roll), float(pitch), None, None)


def filled(
    noise_deg: float = 0.1, rate_hz: float = 50.0, speed_kmh: float = 12.0, seconds: float = 30.0
) -> AttitudeFilter:
    rng = np.random.default_rng(1)
    attitude = AttitudeFilter(AttitudeSettings(lag_s=LAG_S))
    for t in np.arange(0.0, seconds, 1.0 / rate_hz):
        noise = np.deg2rad(rng.normal(0.0, noise_deg, 2))
        pitch = ramp_and_waves(t - LAG_S, speed_kmh)
        attitude.update(inclination(t, -0.5 * pitch + noise[0], pitch + noise[1]))
    return attitude


@pytest.mark.parametrize("speed_kmh", [6.0, 12.0, 24.0])
@pytest.mark.parametrize("rate_hz", [50.0, 100.0])
def test_noise_is_smoothed_and_the_lag_undone(speed_kmh: float, rate_hz: float) -> None:
    attitude = filled(rate_hz=rate_hz, speed_kmh=speed_kmh)
    t = np.arange(2.0, 29.0, 0.013)
    found = attitude.attitudes_at(np.array([ns(x) for x in t]))
    assert found.valid.all()
    truth = ramp_and_waves(t, speed_kmh)
    assert np.rad2deg(np.std(found.pitch_rad - truth)) < 0.05
    assert np.rad2deg(np.std(found.roll_rad + 0.5 * truth)) < 0.05


def test_a_first_order_lag_is_undone() -> None:
    t = np.arange(0.0, 30.0, 0.01)
    truth = ramp_and_waves(t)
    keep = math.exp(-0.01 / LAG_S)
    shown = lfilter([1.0 - keep], [1.0, -keep], truth) + np.deg2rad(np.random.default_rng(1).normal(0, 0.1, len(t)))
    errors = {}
    for kind in ("delay", "first_order"):
        attitude = AttitudeFilter(AttitudeSettings(lag_s=LAG_S, lag_kind=kind))
        for at, pitch in zip(t, shown, strict=True):
            attitude.update(inclination(float(at), 0.0, float(pitch)))
        found = attitude.attitudes_at(np.array([ns(x) for x in t[300:2800]]))
        errors[kind] = np.rad2deg(np.std(found.pitch_rad - truth[300:2800]))
    assert errors["first_order"] < 0.05
    assert errors["first_order"] < errors["delay"]


@pytest.mark.parametrize("speed_kmh", [6.0, 12.0, 24.0])
def test_there_is_no_delay(speed_kmh: float) -> None:
    attitude = filled(noise_deg=0.01, speed_kmh=speed_kmh)
    t = np.arange(2.0, 29.0, 0.013)
    found = attitude.attitudes_at(np.array([ns(x) for x in t]))
    shifts = np.arange(-0.05, 0.0501, 0.001)  # the delay at which the filtered signal fits the truth best
    misfit = [np.std(found.pitch_rad - ramp_and_waves(t + shift, speed_kmh)) for shift in shifts]
    assert abs(shifts[int(np.argmin(misfit))]) < 0.0015


def test_the_stated_deviation_is_true() -> None:
    attitude = filled(noise_deg=0.1, speed_kmh=6.0)
    t = np.arange(2.0, 29.0, 0.05)
    found = attitude.attitudes_at(np.array([ns(x) for x in t]))
    normalised = (found.pitch_rad - ramp_and_waves(t, 6.0)) / found.std_rad
    assert 0.7 < np.sqrt(np.mean(normalised**2)) < 1.2


def test_many_and_one_agree() -> None:
    attitude = filled(seconds=5.0)
    many = attitude.attitudes_at(np.array([ns(3.0), ns(1.0)]))
    one = attitude.attitude_at(ns(1.0))
    assert one is not None
    assert one == (many.roll_rad[1], many.pitch_rad[1], many.std_rad[1])


@given(
    coefficients=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    at=st.floats(1.0, 3.0),
    jitter=st.integers(0, 2**31),
)
@settings(max_examples=40, deadline=None)
def test_a_parabola_is_reproduced_exactly_at_any_spacing(
    coefficients: tuple[float, float, float], at: float, jitter: int
) -> None:
    t = np.sort(np.random.default_rng(jitter).uniform(0.0, 4.0, 200))
    rows = np.polyval(coefficients, t).astype(np.float64)[:, None]
    values, factors = fit_at((t * 1e9).astype(np.int64), rows, np.array([ns(at)]), 0.4, 2.0, 0.1)
    expected = np.polyval(coefficients, at) + 0.1 * np.polyval(np.polyder(coefficients), at)
    assert values[0, 0] == pytest.approx(expected, abs=1e-6)
    assert 0.0 < factors[0] < 2.0


def test_ready_until_is_the_promise_that_nothing_changes_any_more() -> None:
    rng = np.random.default_rng(2)
    attitude = AttitudeFilter(AttitudeSettings())
    promised: dict[int, tuple[float, float, float] | None] = {}
    for k in range(600):
        attitude.update(inclination(0.02 * k, rng.normal(0, 0.01), rng.normal(0, 0.01)))
        ready = attitude.ready_until_ns(ns(0.02 * k))
        if k % 20 == 0 and ready > 0:
            promised[ready] = attitude.attitude_at(ready)
    assert len(promised) > 20
    for stamp, value in promised.items():
        later = attitude.attitude_at(stamp)
        assert value is not None
        assert later is not None
        assert later[:2] == value[:2]


def test_nothing_is_waited_for_when_the_sensor_is_silent() -> None:
    attitude = filled(seconds=2.0)
    assert attitude.ready_until_ns(ns(2.0)) < ns(1.8)
    assert attitude.ready_until_ns(ns(3.0)) == ns(3.0)
    attitude.finish()
    assert attitude.ready_until_ns(ns(2.0)) == ns(2.0)
    assert AttitudeFilter(AttitudeSettings()).ready_until_ns(ns(5.0)) < ns(5.0)


def test_no_attitude_without_samples_or_in_a_gap() -> None:
    attitude = AttitudeFilter(AttitudeSettings())
    assert attitude.attitude_at(ns(1.0)) is None
    for t in [*np.arange(0.0, 2.0, 0.02), *np.arange(6.0, 8.0, 0.02)]:
        attitude.update(inclination(t, 0.01, 0.02))
    assert attitude.attitude_at(ns(4.0)) is None
    assert attitude.attitude_at(ns(12.0)) is None
    inside = attitude.attitude_at(ns(7.0))
    assert inside is not None
    assert inside[:2] == pytest.approx((0.01, 0.02), abs=1e-12)


def test_a_slow_sensor_is_interpolated() -> None:
    attitude = AttitudeFilter(AttitudeSettings(lag_s=0.0))
    for t in np.arange(0.0, 4.0, 0.4):
        attitude.update(inclination(t, 0.0, 0.05 * t))
    found = attitude.attitude_at(ns(1.5))
    assert found is not None
    assert found.pitch_rad == pytest.approx(0.075, abs=1e-9)


def test_bad_samples_are_left_out_and_reported() -> None:
    clean, dirty = AttitudeFilter(AttitudeSettings()), AttitudeFilter(AttitudeSettings())
    for k, t in enumerate(np.arange(0.0, 10.0, 0.02)):
        message = inclination(t, 0.0, float(ramp_and_waves(t)))
        clean.update(message)
        dirty.update(message)
        if k % 10 == 5:
            dirty.update(inclination(t + 0.005, math.nan, 0.0))
            dirty.update(inclination(t + 0.005, 0.0, 0.5))
            dirty.update(inclination(t + 0.005, 0.0, 1.4))
            dirty.update(inclination(t - 1.0, 0.0, 0.01))
    times = np.array([ns(x) for x in np.arange(1.0, 9.0, 0.1)])
    assert dirty.attitudes_at(times).pitch_rad == pytest.approx(clean.attitudes_at(times).pitch_rad, abs=1e-12)
    assert len(dirty.warnings.texts()) == 4
    assert not clean.warnings.texts()


def test_a_level_that_changes_and_stays_is_taken() -> None:
    attitude = AttitudeFilter(AttitudeSettings())
    for t in np.arange(0.0, 10.0, 0.02):
        attitude.update(inclination(t, 0.0, 0.0 if t < 5.0 else 0.2))
    found = attitude.attitude_at(ns(8.0))
    assert found is not None
    assert found.pitch_rad == pytest.approx(0.2, abs=1e-9)
    assert any("level changed" in text for text in attitude.warnings.texts())


def test_a_frozen_sensor_is_reported() -> None:
    attitude = AttitudeFilter(AttitudeSettings())
    for t in np.arange(0.0, 12.0, 0.02):
        attitude.update(inclination(t, 0.01, 0.02))
    assert any("frozen" in text for text in attitude.warnings.texts())


def test_a_gap_keeps_the_attitude_before_and_says_so() -> None:
    """Level was taken instead: on a decline of 8 % a gap of 6 s cost half a metre of height."""
    attitude = AttitudeFilter(AttitudeSettings())
    for t in [*np.arange(0.0, 2.0, 0.02), *np.arange(6.0, 8.0, 0.02)]:
        attitude.update(inclination(t, 0.01, 0.08))
    for t in np.arange(1.0, 7.0, 0.1):
        assert attitude.roll_pitch_at(ns(t)) == pytest.approx((0.01, 0.08), abs=1e-9)
    assert any("silent for" in text for text in attitude.texts())


@pytest.mark.parametrize("roll_deg", [0.0, 180.0, 90.0])
@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 180.0, 30.0])
def test_the_mounting_of_the_inclinometer_is_undone(yaw_deg: float, roll_deg: float) -> None:
    T_base_sensor = se3.from_rpy(math.radians(roll_deg), 0.0, math.radians(yaw_deg))
    attitude = AttitudeFilter(AttitudeSettings(), T_base_sensor[:3, :3])
    R_map_sensor = se3.from_rpy(0.03, -0.08, 1.1)[:3, :3] @ T_base_sensor[:3, :3]
    roll, pitch, _ = se3.to_rpy(R_map_sensor)
    for t in np.arange(0.0, 2.0, 0.02):
        attitude.update(inclination(t, roll, pitch))
    found = attitude.attitude_at(ns(1.0))
    assert found is not None
    assert found[:2] == pytest.approx((0.03, -0.08), abs=1e-9)


def test_memory_stays_bounded() -> None:
    attitude = AttitudeFilter(AttitudeSettings(keep_s=5.0))
    for k in range(20_000):
        attitude.update(inclination(0.01 * k, 0.0, 0.0))
    assert len(attitude._samples._stamps) <= 2048
    assert attitude.attitude_at(ns(198.0)) is not None
    assert attitude.attitude_at(ns(20.0)) is None
