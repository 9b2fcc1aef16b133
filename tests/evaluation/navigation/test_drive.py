"""Times, distances and smoothness of drives with known answers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lhdmap.evaluation.navigation.drive import sampled, smoothness, squared_steps, table_3
from lhdmap.evaluation.navigation.rate_free import rate_free
from lhdmap.evaluation.navigation.signals import SignalCollector, Signals
from lhdmap.machine import Machine
from lhdmap.messages import Command, Tachometer, Text

from tests.evaluation.navigation.drives import START_NS, ns, signals

LARGEST_RPS = math.radians(Machine().dimensions.max_articulation_rate_dps)


def _table_3(found: Signals, mode: str = "") -> dict[str, Any]:
    return table_3(sampled(found, Machine(), mode), found.length_s)


def _smooth(found: Signals) -> dict[str, Any]:
    return smoothness(sampled(found, Machine()))


def test_constant_speed_with_a_stop() -> None:
    drive = signals(60.0, {0.0: "manual"}, speed=lambda t: 0.0 if 20.0 <= t < 30.0 else 2.0)
    found = _table_3(drive)
    assert found["operation"] == "manual"
    assert found["length_s"] == pytest.approx(60.0)
    assert found["navigation_s"] == pytest.approx(50.0, abs=0.1)
    assert found["stop_s"] == pytest.approx(10.0, abs=0.1)
    assert found["mean_speed_kmh"] == pytest.approx(7.2)
    assert found["max_speed_kmh"] == pytest.approx(7.2)
    assert found["td_net_m"] == found["td_travelled_m"] == pytest.approx(100.0, abs=0.2)
    assert (found["teleoperation_s"], found["tad_net_m"], found["heading"]) == (0.0, None, "F")


def test_net_and_travelled_where_a_person_backs_up() -> None:
    """40 s at −2 m/s by the system, 5 s ahead by tele-operation, 10 s back: as runs 8 and 11 of the paper."""
    modes = {0.0: "autonomous", 40.0: "teleoperated", 45.0: "autonomous"}
    found = _table_3(signals(55.0, modes, speed=lambda t: 2.0 if 40.0 <= t < 45.0 else -2.0))
    assert (found["operation"], found["heading"]) == ("autonomous", "B")
    assert found["td_net_m"] == pytest.approx(90.0, abs=0.5)
    assert found["td_travelled_m"] == pytest.approx(110.0, abs=0.5)
    assert found["tad_net_m"] == found["tad_travelled_m"] == pytest.approx(100.0, abs=0.5)
    assert found["tad_net_m"] > found["td_net_m"]
    assert found["teleoperation_s"] == pytest.approx(5.0, abs=0.1)
    assert found["mean_speed_kmh"] == pytest.approx(7.2, abs=0.01)


def test_there_and_back_has_both_headings() -> None:
    assert _table_3(signals(20.0, speed=lambda t: 1.0 if t < 10.0 else -1.0))["heading"] == "both"
    assert _table_3(signals(20.0))["heading"] is None


_CHANGES = st.dictionaries(
    st.floats(0.0, 30.0), st.sampled_from(["idle", "autonomous", "teleoperated", "assisted", "manual"]), min_size=1
)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(_CHANGES, st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=6))
def test_the_parts_make_the_length_and_net_is_at_most_travelled(modes: dict[float, str], speeds: list[float]) -> None:
    span = 30.0 / len(speeds)
    drive = signals(30.0, modes, speed=lambda t: speeds[min(int(t / span), len(speeds) - 1)], rate_hz=20.0)
    found = _table_3(drive)
    parts = (found[name] for name in ("navigation_s", "stop_s", "teleoperation_s", "unknown_s"))
    assert sum(parts) == pytest.approx(found["length_s"], abs=0.1)
    assert found["td_net_m"] <= found["td_travelled_m"] + 1e-9
    if found["tad_net_m"] is not None:
        assert found["tad_net_m"] <= found["tad_travelled_m"] + 1e-9 <= found["td_travelled_m"] + 2e-9


def test_without_a_mode_the_option_tells_who_drove() -> None:
    drive = signals(10.0, speed=lambda _: 2.0)
    untold, told = _table_3(drive), _table_3(drive, "autonomous")
    assert (untold["operation"], untold["teleoperation_s"], untold["tad_net_m"]) == (None, None, None)
    assert untold["navigation_s"] == told["navigation_s"] == pytest.approx(10.0, abs=0.1)
    assert told["tad_travelled_m"] == pytest.approx(20.0, abs=0.2)


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.too_slow])
@given(st.floats(0.01, 0.5), st.integers(2, 10))
def test_held_steps_of_a_command(size: float, every: int) -> None:
    """A command that jumps by a every T seconds, held between: E is a²·Δt at each jump, its mean a²·Δt²/T."""
    period_s, length_s = 0.2 * every, 20.0 * 0.2 * every
    drive = signals(length_s, propel=lambda t: size * (int((t + 1e-6) / period_s) % 2), rate_hz=20.0)
    found = _smooth(drive)
    assert found["mcd"] == pytest.approx(size**2 * 0.1)
    assert found["acd"] == pytest.approx(size**2 * 0.1 * 0.1 / period_s, rel=0.06)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_commands_are_normalised_and_squared(scale: float) -> None:
    drive = signals(20.0, steering=lambda t: scale * 0.25 * LARGEST_RPS * (int(t) % 2))
    assert _smooth(drive)["mcd"] == pytest.approx((scale * 0.25) ** 2 * 0.1)


def test_states_in_kmh_and_degrees() -> None:
    """A steady acceleration of 0.5 m/s² and 2 deg/s: each step of 0.1 s is 0.18 km/h and 0.2 deg."""
    drive = signals(10.0, speed=lambda t: 0.5 * t, angle=lambda t: math.radians(2.0 * t))
    found = _smooth(drive)
    assert [found["asd"], found["msd"]] == pytest.approx([(0.18**2 + 0.2**2) * 0.1] * 2, rel=1e-6)


def test_a_smooth_signal_grows_with_the_third_power_of_the_step() -> None:
    t = np.arange(0.0, 20.0, 0.05)
    values = np.sin(t)
    coarse = squared_steps(values[::2], values[::2], 0.1).mean()
    assert coarse / squared_steps(values, values, 0.05).mean() == pytest.approx(8.0, rel=0.01)


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 100.0])
def test_rate_free_figures(rate_hz: float) -> None:
    """γ of 5 deg at 0.2 Hz and a speed that swings by 0.5 m/s at 0.1 Hz."""
    pace, slow = 2.0 * math.pi * 0.2, 2.0 * math.pi * 0.1
    drive = signals(
        100.0,
        speed=lambda t: 2.0 + 0.5 * math.sin(slow * t),
        angle=lambda t: math.radians(5.0) * math.sin(pace * t),
        rate_hz=rate_hz,
    )
    found = rate_free(drive)
    half = math.sqrt(0.5)
    assert found["steering_rate_rms_dps"] == pytest.approx(5.0 * pace * half, rel=0.02)
    assert found["steering_acceleration_rms_dps2"] == pytest.approx(5.0 * pace**2 * half, rel=0.03)
    assert found["acceleration_rms_mps2"] == pytest.approx(0.5 * slow * half, rel=0.02)


def test_gaps_and_nan_are_unknown_time_and_no_steps() -> None:
    collector = SignalCollector()
    for k in range(1001):
        time_s = k / 50.0
        if not 5.0 < time_s < 9.0:
            speed = 1.0 if time_s <= 5.0 else 3.0
            collector.update(Tachometer(ns(time_s), math.nan if k % 10 == 3 else speed))
        collector.update(Command(ns(time_s), math.inf if k == 7 else 0.5, 0.0, 0.0, 0.0, False, False))
    collector.update(Text(START_NS, " Manual "))
    collector.update(Text(START_NS, "???"))
    drive = collector.signals()
    found, smooth = _table_3(drive), _smooth(drive)
    assert found["unknown_s"] == pytest.approx(4.0, abs=0.2)
    assert found["td_net_m"] == pytest.approx(5.0 + 33.0, abs=0.5)
    assert smooth["acd"] == pytest.approx(0.0, abs=1e-12)
    assert smooth["asd"] is None  # no joints
    assert len(drive.remarks) == 3
    assert "'???'" in " ".join(drive.remarks)


def test_stamps_in_any_order_give_the_same() -> None:
    rng = np.random.default_rng(1)
    stream = [Tachometer(ns(k / 20.0), math.sin(k / 20.0)) for k in range(400)]
    first, second = SignalCollector(), SignalCollector()
    for message in stream:
        first.update(message)
    for k in rng.permutation(400):
        second.update(stream[k])
    assert _table_3(first.signals()) == _table_3(second.signals())


def test_a_mode_of_another_clock_is_left_out() -> None:
    collector = SignalCollector()
    for k in range(100):
        collector.update(Tachometer(k * 50_000_000, 1.0))
    collector.update(Text(START_NS, "manual"))
    drive = collector.signals()
    assert not len(drive.mode.time_s)
    assert "another clock" in drive.remarks[0]


def test_nothing_at_all() -> None:
    drive = SignalCollector().signals(3.0, START_NS)
    found = _table_3(drive)
    assert (found["length_s"], found["unknown_s"], found["mean_speed_kmh"]) == (3.0, 3.0, None)
    assert set(_smooth(drive).values()) == set(rate_free(drive).values()) == {None}
