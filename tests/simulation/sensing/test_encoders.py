"""Tachometer, joints and pressures against the states that they measure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.simulation.history import Column
from lhdmap.simulation.sensing.encoders import (
    JointEncoders,
    PressureGauge,
    drive_line_speed,
    lift_bar,
    tilt_bar,
    transmission_bar,
)
from lhdmap.simulation.sensing.sections import PressureSettings, WheelSettings
from lhdmap.simulation.sensing.sensor import Beat, Sampled

from tests.simulation.sensing.machines import history, readings, times_s

QUIET = PressureSettings(noise_bar=0.0)


def speeds(settings: WheelSettings, seed: int = 8, speed_mps: float = 2.0) -> FloatArray:
    sensor = Sampled("tachometer", Beat(50.0), drive_line_speed(settings, seed), seed)
    past = history(60.0, WHEEL_SPEED=lambda t: speed_mps + 0.0 * t, SPEED=lambda t: 1.0 + 0.0 * t)
    messages: list[Any] = [record.message for record in readings(sensor, past)]
    return np.array([message.speed_mps for message in messages])


def test_the_tachometer_tells_of_the_wheels_with_its_errors() -> None:
    shown = speeds(WheelSettings(scale_error=0.01, noise_mps=0.02))
    assert abs(shown.mean() / 2.0 - 1.0) == pytest.approx(0.01, abs=0.0015)
    assert shown.std() == pytest.approx(0.02, rel=0.05)
    assert (speeds(WheelSettings(), speed_mps=0.0) == 0.0).all()


def test_the_seed_gives_the_sign_of_the_scale_error() -> None:
    signs = [np.sign(speeds(WheelSettings(scale_error=0.05, noise_mps=0.0), seed)[0] - 2.0) for seed in range(40)]
    assert 10 <= signs.count(1.0) <= 30


def test_joint_encoders_follow_the_joints() -> None:
    past = history(
        60.0,
        ARTICULATION=lambda t: 0.005 * t,
        ARTICULATION_RATE=lambda t: 0.005 + 0.0 * t,
        BOOM=lambda t: -0.3 + 0.01 * t,
        BOOM_RATE=lambda t: 0.01 + 0.0 * t,
    )
    records = readings(Sampled("joints", Beat(50.0), JointEncoders(math.radians(0.05)), 8), past)
    messages: list[Any] = [record.message for record in records]
    error = np.array([message.positions_rad["articulation"] for message in messages]) - 0.005 * times_s(records)
    assert np.degrees(error.std()) == pytest.approx(0.05, rel=0.1)
    assert np.mean([message.velocities_rps["articulation"] for message in messages]) == pytest.approx(0.005, abs=2e-4)
    assert messages[-1].positions_rad["boom_lift"] == pytest.approx(0.3, abs=0.005)
    assert messages[-1].velocities_rps["boom_lift"] == pytest.approx(0.01)


def bar(gauge: Any, **columns: float) -> float:
    """Return what a gauge without noise shows of a state."""
    past = history(1.0)
    for name, value in columns.items():
        past.rows[:, Column[name]] = value
    message: Any = readings(Sampled("lift_pressure", Beat(20.0), PressureGauge(gauge, QUIET), 1), past)[3].message
    return float(message.pressure_pa) / 1e5


def test_the_transmission_shows_what_the_wheels_give() -> None:
    assert bar(transmission_bar) == pytest.approx(60.0)
    assert bar(transmission_bar, SPEED=2.0, TRACTION=1.5) == pytest.approx(60.0 + 80.0 * 1.5)
    assert bar(transmission_bar, SPEED=-2.0, TRACTION=-1.5) == pytest.approx(60.0 + 80.0 * 1.5)
    assert bar(transmission_bar, SPEED=2.0, TRACTION=-1.5) == pytest.approx(60.0)  # it brakes
    assert bar(transmission_bar, SPEED=0.0, TRACTION=3.2) == pytest.approx(316.0)  # it pushes against a pile
    assert bar(transmission_bar, SPEED=0.0, TRACTION=9.0) == pytest.approx(420.0)


def test_lift_is_affine_in_the_load_and_tilt_in_what_it_meets() -> None:
    empty, half, full = (bar(lift_bar, LOAD=load_kg, BOOM=0.4) for load_kg in (0.0, 5500.0, 11000.0))
    assert half == pytest.approx(0.5 * (empty + full))
    assert full / empty == pytest.approx((45.0 + 99.0) / 45.0)
    assert bar(lift_bar, BOOM=0.4) == pytest.approx(bar(lift_bar) * math.cos(0.4))
    assert bar(tilt_bar) < 23.0 < bar(tilt_bar, CURL=0.1)  # the paper's threshold for the bucket on the ground
    assert bar(tilt_bar, CURL=1.0) == pytest.approx(250.0)
