"""A joint that does not follow is found soon; one that is a little other than its model, or noisy, is not held up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.driving.motion import Motion
from lhdmap.executor.joint import JointWatch
from lhdmap.executor.settings import ExecutorSettings

from tests.executor.rig import MODEL, MS, Rig

LIMIT_RAD = math.radians(ExecutorSettings().joint_deg)
STEP_S = 0.01


def apart(
    rates_rps: list[float],
    gain: float = 1.0,
    lag: float = 1.0,
    late_s: float = 0.0,
    noise_rad: float = 0.0,
    stuck_from: int = 10**9,
) -> list[float]:
    """Return what the watch says each 10 ms of a joint that is told these rates."""
    watch, rng = JointWatch(MODEL), np.random.default_rng(1)
    dead = round((MODEL.dead_time_s + late_s) / STEP_S)
    bend = rate = 0.0
    said = []
    for k, told in enumerate(rates_rps):
        now = k * 10 * MS
        seen = bend + noise_rad * float(rng.standard_normal())
        said.append(watch.sees(Motion(now, 0.0, 0.0, 0.0, seen, rate, 2.0)))
        watch.gave(now, told)
        wanted = gain * (rates_rps[k - dead] if k >= dead else 0.0)
        rate += (wanted - rate) * -math.expm1(-STEP_S / (lag * MODEL.steering_lag_s))
        if k < stuck_from:
            bend = min(max(bend + rate * STEP_S, -MODEL.max_articulation_rad), MODEL.max_articulation_rad)
    return said


def weaving(seconds: float, most_dps: float) -> list[float]:
    t = np.arange(0.0, seconds, STEP_S)
    rates: list[float] = np.radians(most_dps * np.sin(2.0 * math.pi * t / 4.0)).tolist()
    return rates


def test_a_joint_as_modelled_is_not_off() -> None:
    assert max(map(abs, apart(weaving(12.0, 12.0)))) < math.radians(0.15)


@pytest.mark.parametrize(
    ("gain", "lag", "late_s", "noise_deg"),
    [(0.85, 1.0, 0.0, 0.1), (1.15, 1.1, 0.0, 0.1), (1.0, 1.0, 0.15, 0.1), (1.0, 1.0, -0.15, 0.1), (1.0, 1.0, 0.0, 0.5)],
)
def test_errors_of_the_model_and_noise_stop_nothing(gain: float, lag: float, late_s: float, noise_deg: float) -> None:
    said = apart(weaving(12.0, 12.0), gain, lag, late_s, math.radians(noise_deg))
    assert max(map(abs, said)) < LIMIT_RAD


def test_a_joint_against_its_stop_is_not_off() -> None:
    assert max(map(abs, apart([math.radians(12.0)] * 600))) < math.radians(1.5)


@pytest.mark.parametrize("rate_dps", [6.0, 8.0, -12.0])
def test_a_stuck_joint_is_found_once_it_misses_the_limit(rate_dps: float) -> None:
    said = np.abs(apart([math.radians(rate_dps)] * 300, stuck_from=100))
    assert said[:100].max() < 0.1 * LIMIT_RAD
    found_s = STEP_S * (int(np.argmax(said > LIMIT_RAD)) - 100)
    assert found_s == pytest.approx(math.degrees(LIMIT_RAD) / abs(rate_dps), abs=0.03)


def test_the_machine_is_stopped_and_disarmed() -> None:
    rig = Rig()  # its joint never moves
    rig.run(0.5)
    assert rig.control.rearm(rig.now_ns, "autonomous") == ()
    assert rig.control.mode("autonomous", rig.now_ns)
    armed = []
    for rate_dps, seconds in ((0.0, 4.0), (8.0, 1.2)):
        rig.rate_wanted = math.radians(rate_dps)
        rig.run(seconds)
        armed.append(rig.control.watchdog.armed)
    assert armed == [True, False]
    assert "deg off its commands" in rig.control.watchdog.causes[0]
    assert rig.command.brake
