"""Hydrostatic drive, axle loads and tyres of the digging machine against what is known of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.loading.signals import Pedals
from lhdmap.simulation.ground.kernel import GRAVITY_MPS2, World, advance
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.records import State, record, state_of
from lhdmap.simulation.ground.rig import rig_of

from tests.simulation.ground.digs import MACHINE, charged, quiet

RIG = rig_of(MACHINE)


def floor_world() -> World:
    return World(np.zeros(60), np.ones((15, 3)), np.ones(1), np.zeros((0, 3)), np.zeros((0, 3)))


def run(state: State, pedals: Pedals, seconds: float, *, friction: float = 0.6) -> State:
    """Step a machine on a floor without a pile."""
    from lhdmap.simulation.ground.draws import draw_load

    rock, one = draw_load(quiet(), 0).rock.copy(), record(state)
    rock["friction"], rock["origin_m"] = friction, 1e6
    row = np.array([*pedals[:3], float(pedals.full_rpm), float(pedals.brake)])
    advance(one, RIG, rock, floor_world(), row, round(seconds / 0.002), 0.002)
    return state_of(one)


def test_free_rolling_at_half_pedal() -> None:
    state = run(State(engine=0.35), Pedals(0.5), 12.0)
    assert state.speed_mps == pytest.approx(0.87, abs=0.01)
    assert state.pressure_pa * 1e-5 == pytest.approx(46.0, abs=1.5)


def test_first_gear_at_full_pedal() -> None:
    state = run(State(engine=0.35), Pedals(1.0, full_rpm=True), 15.0)
    assert state.speed_mps == pytest.approx(2.6, rel=0.03)


def test_a_wall_stalls_it_above_300_bar() -> None:
    loader = Loader(MACHINE, quiet(rock={"hardness": 400.0, "hardness_sigma": 0.0, "attempt_sigma": 0.0}))
    charged(loader, loader.begin(1))
    for _ in range(100):
        signals = loader.step(Pedals(0.5), 0.02)
    assert loader.truth.speed_mps == 0.0
    assert 300.0 < signals.transmission_bar < 380.0
    assert loader.truth.lip_x_m < 0.15


def test_what_the_pressure_gives_is_what_the_tyres_hold() -> None:
    """At a stall, D p / r less the drive line's losses is the tyres' force."""
    loader = Loader(MACHINE, quiet(rock={"hardness": 400.0, "hardness_sigma": 0.0, "attempt_sigma": 0.0}))
    charged(loader, loader.begin(1))
    for _ in range(150):
        loader.step(Pedals(0.5), 0.02)
    digging, state = MACHINE.digging, loader.state
    drive = (
        digging.displacement_l * 1e-3 * (state.pressure_pa - 1e5 * digging.loss_bar) / MACHINE.dimensions.wheel_radius_m
    )
    assert state.traction_n == pytest.approx(drive, rel=0.02)


@pytest.mark.parametrize(("content", "lip_up_n"), [(0.0, 0.0), (5.0, 0.0), (3.0, 60e3)])
def test_axle_loads_are_statics(content: float, lip_up_n: float) -> None:
    """Moments about the rear axle; the reaction of the rock pulls the lip down."""
    given = State(engine=0.35, content_m3=content, down_n=lip_up_n, up_n=lip_up_n)
    rock_kg_m3 = 2420.0 / 1.1
    state = run(given, Pedals(brake=True), 0.002)
    base, back = MACHINE.dimensions.wheelbase_m, MACHINE.digging.gravity_centre_m
    reach = state.lip_x_m - state.x_m
    weight, load = MACHINE.drive.mass_kg * GRAVITY_MPS2, content * rock_kg_m3 * GRAVITY_MPS2
    down = state.tilting * MACHINE.digging.tilt_force_kn * 1e3
    front = (weight * (base - back) + load * (base + reach - 0.9) + down * (base + reach)) / base
    assert state.front_n == pytest.approx(front, rel=0.02)
    assert state.front_n + state.rear_n == pytest.approx(weight + load + down, rel=0.02)


def test_spinning_wheels_give_the_friction() -> None:
    loader = Loader(MACHINE, quiet(rock={"hardness": 400.0, "hardness_sigma": 0.0}, floor={"friction": (0.2, 0.2)}))
    charged(loader, loader.begin(1))
    for _ in range(100):
        loader.step(Pedals(1.0, full_rpm=True), 0.02)
    truth = loader.truth
    assert truth.slip > 0.9
    assert truth.slip_s > 1.0
    assert truth.traction_n == pytest.approx(0.2 * (truth.front_n + truth.rear_n), rel=0.01)


def test_power_limits_the_speed_uphill() -> None:
    state = run(
        State(engine=1.0, speed_mps=2.0, wheel_mps=2.0, pull_n=-100e3), Pedals(1.0, full_rpm=True), 15.0, friction=0.9
    )
    flow = RIG["displacement_m3"][0] * state.wheel_mps / 0.8 + RIG["leakage_m3"][0] * state.pressure_pa
    assert state.pressure_pa * flow == pytest.approx(150e3, rel=0.02)


def test_brakes_hold_on_a_slope_without_creeping() -> None:
    slope = run(State(engine=0.35, pull_n=30e3), Pedals(brake=True), 20.0)
    assert slope.speed_mps == 0.0
    assert abs(slope.x_m) < 0.02


def test_it_stops_and_reverses() -> None:
    state = run(State(engine=0.35), Pedals(0.5), 5.0)
    state = run(state, Pedals(-0.5), 8.0)
    assert state.speed_mps == pytest.approx(-0.87, abs=0.02)
    assert math.isfinite(state.pressure_pa)


def test_no_pedal_is_no_number() -> None:
    loader = Loader(MACHINE, quiet())
    signals = loader.begin(3)
    for _ in range(50):
        signals = loader.step(Pedals(math.nan, math.inf, -math.inf), 0.02)
    assert loader.truth.speed_mps == pytest.approx(0.0, abs=1e-9)
    assert all(math.isfinite(value) for value in signals)
