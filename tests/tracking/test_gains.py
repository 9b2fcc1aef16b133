"""Gains: the findings' values, stable at each speed of either sign, and none of the wrong sign."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import reduced
from lhdmap.tracking.gains import Gains, gain_of, held, riccati
from lhdmap.tracking.settings import TrackingSettings
from scipy.linalg import expm, solve_discrete_are

from tests.tracking.machines import LENGTHS, MODELS

SETTINGS = TrackingSettings()
GAINS = {name: Gains(model, SETTINGS) for name, model in MODELS.items()}
FOUND = {
    ("truck", 1.4): (1.02, 5.45, 3.42, 0.24),
    ("truck", -1.4): (1.02, -2.80, 0.94, 0.24),
    ("loader", 1.4): (1.02, 5.40, 4.60, 0.25),
    ("loader", -1.4): (1.02, -1.95, 0.93, 0.25),
}


@pytest.mark.parametrize(("which", "gain"), FOUND.items())
def test_gains_are_those_of_the_findings(which: tuple[str, float], gain: tuple[float, ...]) -> None:
    model = MODELS[which[0]]._replace(steering_lag_s=0.15)
    assert gain_of(which[1], model, SETTINGS) == pytest.approx(gain, abs=0.006)


def slowest(name: str, speed: float, gain: FloatArray) -> float:
    a, b = reduced(speed, MODELS[name].steering_lag_s, LENGTHS[name])
    return float(np.linalg.eigvals(a - b @ gain[None]).real.max())


@given(st.sampled_from(sorted(MODELS)), st.floats(0.3, 13.0), st.sampled_from([1, -1]), st.sampled_from([1, -1]))
def test_no_gain_of_the_wrong_sign_can_be_had(name: str, speed: float, sign: int, gear: int) -> None:
    """Whatever gear is told: a machine that rolls the other way gets the gain of how it moves."""
    gain = GAINS[name].at(sign * speed, gear)
    share = min(speed / SETTINGS.slow_mps, 1.0)  # the joint comes to rest with the machine
    assert slowest(name, sign * speed, share * gain) < -0.03
    assert gain[1] * sign > 0.0


@given(st.sampled_from(sorted(MODELS)), st.floats(-0.14, 0.14), st.sampled_from([1, -1]))
def test_where_it_stands_the_gear_decides(name: str, speed: float, gear: int) -> None:
    assert GAINS[name].at(speed, gear)[1] * gear > 0.0


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("speed", [1.4, 8.3])
def test_the_gain_of_the_other_sign_is_unstable(name: str, speed: float) -> None:
    """Why it matters."""
    assert slowest(name, speed, GAINS[name].at(-speed, -1)) > 0.2
    assert slowest(name, -speed, GAINS[name].at(speed, 1)) > 0.2


def test_the_slowest_poles_are_those_of_the_findings() -> None:
    model = MODELS["truck"]._replace(steering_lag_s=0.15)
    for speed, pole in ((1.4, -0.44), (8.3, -1.27)):
        assert slowest("truck", speed, gain_of(speed, model, SETTINGS)) == pytest.approx(pole, rel=0.08)


@pytest.mark.parametrize("speed", [-2.2, 0.4, 5.0])
def test_doubling_solves_the_riccati_equation(speed: float) -> None:
    a, b = held(*reduced(speed, 0.2, LENGTHS["truck"]), 0.05)
    whole = np.zeros((5, 5))
    whole[:4] = 0.05 * np.hstack(reduced(speed, 0.2, LENGTHS["truck"]))
    assert np.hstack([a, b]) == pytest.approx(expm(whole)[:4])
    q = np.diag([450.0, 20.0, 5.0, 0.1])
    assert riccati(a, b @ b.T / 400.0, q) == pytest.approx(solve_discrete_are(a, b, q, np.array([[400.0]])), rel=1e-8)


def test_weights_count() -> None:
    calm = dataclasses.replace(SETTINGS, rate_weight=1600.0)
    assert gain_of(2.0, MODELS["truck"], calm)[0] < 0.6 * gain_of(2.0, MODELS["truck"], SETTINGS)[0]
