"""The turn by the gyroscope is that of the heading, whatever the mount and the attitude."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray, Inclination
from lhdmap.proprioception.gyro import Gyro, GyroSettings

RATE_HZ, LAG_S = 100, 0.1
SECONDS = 20


def _attitude(t: float) -> FloatArray:
    """Roll, pitch and heading of a machine that sways on a slope while it turns."""
    return np.array(
        [0.05 * math.sin(5.0 * t), 0.08 + 0.04 * math.sin(3.0 * t + 1.0), 0.3 * t + 0.2 * math.sin(0.7 * t)]
    )


def _rates(t: float) -> FloatArray:
    """Angular velocity in the body's frame, from two rotation matrices a moment apart."""
    h = 1e-5
    before, after = (se3.from_rpy(*_attitude(t + d))[:3, :3] for d in (-h, h))
    turn = before.T @ after
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (4.0 * h)


def _messages(R_base_sensor: FloatArray, factor: float = 1.0) -> list[Inclination]:
    out = []
    for k in range(SECONDS * RATE_HZ):
        t = k / RATE_HZ
        shown = se3.from_rpy(*_attitude(t - LAG_S))[:3, :3] @ R_base_sensor
        T = np.eye(4)
        T[:3, :3] = shown
        roll, pitch, _ = se3.to_rpy(T)
        rates = factor * R_base_sensor.T @ _rates(t)
        out.append(Inclination(round(t * 1e9), "imu", roll, pitch, rates, None))
    return out


def _error_rad(gyro: Gyro, first_s: float, last_s: float) -> float:
    turned = gyro.turn_between(round(first_s * 1e9), round(last_s * 1e9))
    assert turned is not None
    return float(turned - (_attitude(last_s)[2] - _attitude(first_s)[2]))


@settings(max_examples=8, deadline=None)
@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-3.1, 3.1))
def test_the_heading_turns_whatever_the_mount(roll: float, pitch: float, yaw: float) -> None:
    mount = se3.from_rpy(roll, pitch, yaw)[:3, :3]
    gyro = Gyro(GyroSettings(), LAG_S, mount)
    for message in _messages(mount):
        gyro.update(message)
    assert abs(_error_rad(gyro, 1.0, 19.0)) < math.radians(0.05)


def test_a_gap_is_not_bridged() -> None:
    gyro = Gyro(GyroSettings(), LAG_S)
    for k, message in enumerate(_messages(np.eye(3))):
        if not 500 <= k < 600:
            gyro.update(message)
    assert gyro.turn_between(4_000_000_000, 7_000_000_000) is None
    assert abs(_error_rad(gyro, 7.0, 12.0)) < math.radians(0.05)


def test_degrees_for_radians_cannot_be() -> None:
    gyro = Gyro(GyroSettings(), LAG_S)
    for message in _messages(np.eye(3), 57.3):
        gyro.update(message)
    assert gyro.impossible > gyro.taken
    assert any("is it in degrees?" in text for text in gyro.texts())


def test_a_message_without_a_rate_says_nothing() -> None:
    gyro = Gyro(GyroSettings(), LAG_S)
    for message in _messages(np.eye(3)):
        gyro.update(message._replace(angular_velocity_rps=None))
    assert not gyro.there
    assert gyro.turn_between(0, 1_000_000_000) is None


@pytest.mark.parametrize("noise_dps", [0.03, 0.05, 0.09])
def test_its_noise_is_learned_from_its_readings(noise_dps: float) -> None:
    rng = np.random.default_rng(1)
    gyro = Gyro(GyroSettings(), LAG_S)
    for message in _messages(np.eye(3)):
        rate = message.angular_velocity_rps
        assert rate is not None
        gyro.update(message._replace(angular_velocity_rps=rate + math.radians(noise_dps) * rng.standard_normal(3)))
    assert gyro.noise_deg_sqrt_h == pytest.approx(
        1.2 * noise_dps * 6.0, rel=0.25
    )  # 0.1 deg/s at 100 Hz: 0.6 deg/sqrt(h)


def test_what_the_message_tells_of_its_noise_counts() -> None:
    gyro = Gyro(GyroSettings(), LAG_S)
    for message in _messages(np.eye(3)):
        gyro.update(message._replace(angular_velocity_std_rps=math.radians(1.0)))
    assert gyro.noise_deg_sqrt_h == pytest.approx(1.2 * 6.0, rel=0.05)
