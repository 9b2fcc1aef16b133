"""The inclinometer and the inertial sensors against motions in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lhdmap.geometry import se3
from lhdmap.machine import SensorMount
from lhdmap.messages import FloatArray
from lhdmap.simulation.history import History
from lhdmap.simulation.sensing.inclinometer import Inclinometer
from lhdmap.simulation.sensing.sections import ImuSettings, InclinometerSettings

from tests.simulation.sensing.machines import history, readings, times_s

EXACT = ImuSettings(
    gyro=True,
    gyro_noise_dps=0.0,
    gyro_bias_dps=0.0,
    gyro_walk_dps=0.0,
    accelerometer=True,
    acceleration_noise_mps2=0.0,
    acceleration_bias_mps2=0.0,
    acceleration_walk_mps2=0.0,
    vibration_mps2=0.0,
    road_mps2=0.0,
)
STILL = InclinometerSettings(noise_deg=0.0, lag_s=0.0)


def pitches(settings: InclinometerSettings, past: History) -> tuple[FloatArray, FloatArray]:
    records = readings(Inclinometer(settings, ImuSettings(), SensorMount(), 8), past)
    messages: list[Any] = [record.message for record in records]
    return times_s(records), np.array([message.pitch_rad for message in messages])


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0])
@pytest.mark.parametrize("kind", ["first_order", "delay"])
def test_it_lags_by_its_lag_whatever_the_rate_of_the_history(kind: str, rate_hz: float) -> None:
    settings = InclinometerSettings(noise_deg=0.0, lag_s=0.1, lag_kind=kind, rate_hz=80.0)
    time_s, shown = pitches(settings, history(6.0, rate_hz, PITCH=lambda t: 0.01 * t))
    late = time_s > 2.5
    assert shown[late] == pytest.approx(0.01 * (time_s[late] - 0.1), abs=1e-9)


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0])
def test_a_first_order_lag_answers_a_step_with_its_time_constant(rate_hz: float) -> None:
    settings = InclinometerSettings(noise_deg=0.0, lag_s=0.1)
    _, shown = pitches(settings, history(3.0, rate_hz, PITCH=lambda t: np.where(t >= 1.0, 1.0, 0.0)))
    answer = 1.0 - np.exp(-np.array([0.1, 0.3, 0.5]) / 0.1)
    assert shown[[90, 110, 130, 150, 300]] == pytest.approx([0.0, *answer, 1.0], abs=0.02)
    assert shown[[110, 130, 150]] == pytest.approx(1.0 - (1.0 - answer) * math.exp(-0.5 / rate_hz / 0.1), abs=2e-3)


def test_it_has_its_noise_and_bias() -> None:
    settings = InclinometerSettings(noise_deg=0.2, bias_pitch_deg=0.5, lag_s=0.0)
    time_s, shown = pitches(settings, history(60.0, PITCH=lambda t: 0.01 * t))
    error = np.degrees(shown - 0.01 * time_s)
    assert error.mean() == pytest.approx(0.5, abs=0.02)
    assert error.std() == pytest.approx(0.2, rel=0.05)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(0.0, abs=0.05)


def inertial(past: History, imu: ImuSettings = EXACT, mount: SensorMount | None = None) -> tuple[FloatArray, ...]:
    records = readings(Inclinometer(STILL, imu, mount or SensorMount(), 8), past)
    messages: list[Any] = [record.message for record in records]
    rates = np.array([message.angular_velocity_rps for message in messages])
    return times_s(records), rates, np.array([message.acceleration_mps2 for message in messages])


def test_at_rest_there_is_gravity_alone_in_the_sensors_frame() -> None:
    mount = SensorMount("base_link", (-0.5, 0.2, 1.0), roll_deg=20.0, yaw_deg=90.0)
    past = history(1.0, ROLL=lambda t: 0.1 + 0.0 * t, PITCH=lambda t: -0.2 + 0.0 * t, YAW=lambda t: 2.0 + 0.0 * t)
    _, rates, felt = inertial(past, mount=mount)
    R_map_sensor = (se3.from_rpy(0.1, -0.2, 2.0) @ mount.T_parent_sensor)[:3, :3]
    assert np.abs(rates).max() < 1e-9
    assert felt[20:] == pytest.approx(np.tile(R_map_sensor.T @ [0.0, 0.0, 9.81], (len(felt) - 20, 1)), abs=1e-6)


def test_on_a_circle_it_feels_the_turn_and_the_pull_inwards() -> None:
    """Speed 2 m/s, radius 8 m, tilted by its mount: w = v / r about the vertical, a = v² / r to the left."""
    rate = 2.0 / 8.0
    past = history(
        4.0,
        1000.0,
        X=lambda t: 8.0 * np.sin(rate * t),
        Y=lambda t: 8.0 * (1.0 - np.cos(rate * t)),
        YAW=lambda t: rate * t,
    )
    time_s, rates, felt = inertial(past)
    assert rates[time_s > 1.0] == pytest.approx(np.array([[0.0, 0.0, rate]] * int((time_s > 1.0).sum())), abs=1e-6)
    turning = felt[time_s > 1.0]
    assert turning.mean(axis=0) == pytest.approx([0.0, 0.5, 9.81], abs=0.003)


def test_turning_while_tilted_shows_in_all_axes_of_the_gyroscope() -> None:
    """The same as a small rotation between two attitudes, taken from matrices."""
    past = history(2.0, 1000.0, ROLL=lambda t: 0.1 * t, PITCH=lambda t: 0.2 - 0.05 * t, YAW=lambda t: 0.3 * t)
    time_s, rates, _ = inertial(past)
    for k in (50, 120, 190):
        before, after = (se3.from_rpy(0.1 * t, 0.2 - 0.05 * t, 0.3 * t)[:3, :3] for t in (time_s[k] - 0.01, time_s[k]))
        turn = before.T @ after
        expected = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 0.02
        assert rates[k] == pytest.approx(expected, abs=1e-3)


def test_errors_of_the_gyroscope_have_their_size() -> None:
    imu = ImuSettings(gyro=True, gyro_noise_dps=0.1, gyro_bias_dps=0.0, gyro_walk_dps=0.05)
    records = readings(Inclinometer(STILL, imu, SensorMount(), 8), history(300.0))
    messages: list[Any] = [record.message for record in records]
    shown = np.degrees(np.array([message.angular_velocity_rps for message in messages]))
    assert np.diff(shown, axis=0).std() == pytest.approx(0.1 * math.sqrt(2.0), rel=0.03)
    seconds = shown[: 300 * 100].reshape(300, 100, 3).mean(axis=1)  # white noise of 0.01, walk of 0.05 in a second
    assert np.diff(seconds, axis=0).std() == pytest.approx(
        math.hypot(0.05 * math.sqrt(2 / 3), 0.01 * math.sqrt(2)), rel=0.1
    )


def test_without_them_the_message_says_nothing_of_rates() -> None:
    message: Any = readings(Inclinometer(STILL, ImuSettings(), SensorMount(), 8), history(0.1))[0].message
    assert message.angular_velocity_rps is None
    assert message.acceleration_mps2 is None
