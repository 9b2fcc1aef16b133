"""Drive, brakes and tyres against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.machine import Machine
from lhdmap.machine_sections import Drive
from lhdmap.messages import FloatArray
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.tyres import carried_speed, slip_for, tyre_force, wheel_for
from lhdmap.simulation.vehicle.vehicle import Vehicle

from tests.simulation.vehicle.grounds import STEP_S, Plane, column, command, drive, since_it_counts

TOP_MPS = 24.0 / 3.6
G = 9.81
STRONG = Machine(drive=Drive(engine_power_kw=2000.0))  # holds 20 km/h on 12 %


def at_rest(vehicle: Vehicle, load_kg: float = 0.0) -> VehicleState:
    return vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, load_kg=load_kg, time_ns=0)


def first_order(t: FloatArray, target: float, lag_s: float, limit: float) -> FloatArray:
    """Speed from rest towards a target: at the limit until first order asks for less, then exponential."""
    turn = max(target / limit - lag_s, 0.0)
    return np.where(
        t < 0.0,
        0.0,
        np.where(t < turn, limit * t, target - (target - limit * turn) * np.exp(-np.maximum(t - turn, 0.0) / lag_s)),
    )


@pytest.mark.parametrize("propel", [0.04, 0.3, -0.3, 0.6])
@pytest.mark.parametrize(("load_kg", "lag_s", "limit"), [(0.0, 0.5, 1.0), (11_000.0, 0.7, 0.6), (5_500.0, 0.6, 0.8)])
def test_speed_follows_a_step_after_the_dead_time(propel: float, load_kg: float, lag_s: float, limit: float) -> None:
    vehicle = Vehicle(STRONG, Plane())
    states = drive(vehicle, at_rest(vehicle, load_kg), command(propel), 10.0)
    t = since_it_counts(states)
    wanted = math.copysign(1.0, propel) * first_order(t, abs(propel) * TOP_MPS, lag_s, limit)
    wheel, speed = column(states, "wheel_speed_mps"), column(states, "speed_mps")
    assert np.abs(wheel - wanted).max() < 0.01 * abs(propel) * TOP_MPS
    slip = -math.log(1.0 - 0.035 / 0.6) / 8.0  # of rolling steadily
    assert speed[-1] == pytest.approx(wheel[-1] * (1.0 - slip), rel=1e-4)
    moving = np.abs(wheel) > 0.1
    assert (np.abs(speed[moving]) <= np.abs(wheel[moving])).all()
    assert np.abs(speed - wheel).max() < 0.05 * abs(propel) * TOP_MPS + 0.005


@pytest.mark.parametrize("load_kg", [0.0, 11_000.0])
@pytest.mark.parametrize("grade", [0.0, 0.12, -0.12])
@pytest.mark.parametrize("kmh", [6.0, 12.0, 20.0])
def test_stopping_distances_balance_the_energy(kmh: float, grade: float, load_kg: float) -> None:
    """Way of the dead time, of the brakes' ramp, and v² / 2a: what brake, rolling and grade take of the kinetic energy."""
    vehicle = Vehicle(STRONG, Plane(grade))
    before = drive(vehicle, at_rest(vehicle, load_kg), command(kmh / 24.0), 20.0)[-1]
    speed = before.speed_mps
    assert speed == pytest.approx(kmh / 3.6, rel=0.05)
    states = drive(vehicle, before, command(kmh / 24.0, brake=True), 9.0)
    level = math.cos(math.atan(grade))
    always, brake = G * level * (0.035 + grade), 2.0 if load_kg else 2.5
    ramp = 0.3
    ramped = speed - always * ramp - 0.5 * brake * ramp
    way = speed * (0.25 + ramp) - 0.5 * always * ramp**2 - brake * ramp**2 / 6.0 + ramped**2 / (2.0 * (always + brake))
    assert states[-1].speed_mps == 0.0
    assert (states[-1].x_m - before.x_m) / level == pytest.approx(way, rel=5e-3)


@pytest.mark.parametrize("brake", [True, False])
@pytest.mark.parametrize("grade", [0.15, -0.12])
def test_it_stands_on_a_grade_by_brake_or_drive(grade: float, brake: bool) -> None:
    vehicle = Vehicle(Machine(), Plane(grade))
    states = drive(vehicle, at_rest(vehicle, 11_000.0), command(0.0, brake=brake), 5.0)
    assert set(column(states, "x_m")) == {0.0}
    assert set(column(states, "wheel_speed_mps")) == {0.0}
    assert states[-1].traction_mps2 == pytest.approx(G * math.sin(math.atan(grade)))


def test_it_slides_where_the_floor_does_not_hold_it() -> None:
    """Locked wheels on mud: gravity less friction, uniformly accelerated."""
    vehicle = Vehicle(Machine(), Plane(-0.12, friction=0.08))
    states = drive(vehicle, at_rest(vehicle)._replace(brake=1.0), command(brake=True), 3.25)
    level = math.cos(math.atan(0.12))
    start = next(k for k, state in enumerate(states) if state.speed_mps > 0.0)
    held = states[start + 40 :]
    gain = (held[-1].speed_mps - held[0].speed_mps) / ((len(held) - 1) * STEP_S)
    assert gain == pytest.approx(G * level * (0.12 - 0.08), rel=0.01)
    assert held[-1].wheel_speed_mps == 0.0


def test_wheels_lock_where_the_brakes_are_stronger_than_the_floor() -> None:
    vehicle = Vehicle(STRONG, Plane(friction=0.15))
    before = drive(vehicle, at_rest(vehicle), command(0.5), 15.0)[-1]
    states = drive(vehicle, before, command(0.5, brake=True), 2.0)
    speed, wheel = column(states, "speed_mps"), column(states, "wheel_speed_mps")
    assert wheel[60:].max() == 0.0
    assert speed[60] > 1.0
    assert (speed[60] - speed[100]) / 0.4 == pytest.approx(0.15 * G, rel=1e-3)


def test_wheels_spin_where_the_drive_is_stronger_than_the_floor() -> None:
    vehicle = Vehicle(STRONG, Plane(friction=0.08))
    states = drive(vehicle, at_rest(vehicle), command(0.6), 6.0)
    t = since_it_counts(states)
    wheel, speed = column(states, "wheel_speed_mps"), column(states, "speed_mps")
    assert np.abs(wheel - first_order(t, 4.0, 0.5, 1.0)).max() < 0.04  # it runs to what is wanted, held by nothing
    early = (speed[150] - speed[50]) / 1.0
    assert early == pytest.approx(G * (0.08 - 0.035), rel=0.03)
    assert wheel[300] - speed[300] > 1.0


def test_the_engine_limits_a_climb() -> None:
    """Uphill the wheels turn no faster than the power over the force that grade and rolling take."""
    vehicle = Vehicle(Machine(), Plane(0.12))
    end = drive(vehicle, at_rest(vehicle, 11_000.0), command(1.0), 40.0)[-1]
    force = 41_000.0 * G * math.cos(math.atan(0.12)) * (0.12 + 0.035)
    assert end.wheel_speed_mps * force == pytest.approx(150e3, rel=5e-3)
    slip = -math.log(1.0 - force / (0.6 * 41_000.0 * G * math.cos(math.atan(0.12)))) / 8.0
    assert end.speed_mps == pytest.approx(end.wheel_speed_mps * (1.0 - slip), rel=1e-3)


def test_too_steep_a_grade_stalls_the_drive() -> None:
    """The relief valve opens at 35 kN of gravity: it stands where rolling resistance helps enough, else it rolls back."""
    for most_kn, speed_mps in ((30.0, 0.0), (20.0, -3.25 * (35.07 - 20.0 - 10.23) / 30.0)):
        vehicle = Vehicle(Machine(drive=Drive(max_force_kn=most_kn)), Plane(0.12))
        end = drive(vehicle, at_rest(vehicle), command(1.0), 3.25)[-1]
        assert end.speed_mps == pytest.approx(speed_mps, rel=0.05)
        assert end.traction_mps2 == pytest.approx(most_kn / 30.0, rel=0.01)


@pytest.mark.parametrize("grade", [0.0, 0.08])
def test_reverse_is_the_mirror_of_forward(grade: float) -> None:
    runs = []
    for way in (1.0, -1.0):
        vehicle = Vehicle(Machine(), Plane(way * grade))
        moving = drive(vehicle, at_rest(vehicle), command(0.7 * way), 6.0)
        runs.append(
            [
                *moving,
                *drive(vehicle, moving[-1], command(-0.3 * way), 6.0),
                *drive(vehicle, moving[-1], command(brake=True), 4.0),
            ]
        )
    for name in ("x_m", "speed_mps", "wheel_speed_mps", "traction_mps2"):
        assert np.abs(column(runs[0], name) + column(runs[1], name)).max() < 1e-9


def test_gears_change_through_standstill_only() -> None:
    vehicle = Vehicle(Machine(), Plane())
    forward = drive(vehicle, at_rest(vehicle), command(0.6), 8.0)
    states = drive(vehicle, forward[-1], command(-0.6), 12.0)
    wheel = column(states, "wheel_speed_mps")
    falls = -np.diff(wheel) / STEP_S
    assert falls.max() < 1.5 + 1e-9  # never faster than the drive holds back
    slow = wheel[np.argmax(wheel < 0.6) : np.argmax(wheel < 0.06)]
    assert np.allclose(slow[1:] / slow[:-1], math.exp(-STEP_S / 0.5), rtol=1e-3)  # it wants nought before it turns
    assert wheel[-1] == pytest.approx(-4.0, rel=0.01)


def test_the_brake_goes_off_in_its_ramp() -> None:
    vehicle = Vehicle(Machine(), Plane())
    on = drive(vehicle, at_rest(vehicle), command(brake=True), 1.0)
    brake = column(drive(vehicle, on[-1], command(0.3), 1.0), "brake")
    assert brake[0] == 1.0
    assert brake[25] == 1.0
    assert brake[40] == pytest.approx(0.5)
    assert brake[-1] == 0.0


@given(st.floats(0.0, 0.95), st.floats(0.05, 1.0), st.sampled_from([-1.0, 1.0]))
def test_the_slip_curve_and_its_inverse(share: float, grip: float, way: float) -> None:
    grip_n = grip * 3e5
    slip = slip_for(way * share * grip_n, grip_n, 8.0)
    assert 1.0 - math.exp(-8.0 * slip) == pytest.approx(share, abs=1e-9)


@given(st.floats(-7.0, 7.0), st.floats(-0.95, 0.95))
def test_wheels_that_turn_as_the_force_wants_give_it(speed_mps: float, share: float) -> None:
    wheel = wheel_for(share * 2e5, speed_mps, 2e5, 8.0)
    assert tyre_force(wheel, speed_mps, 2e5, 8.0) == pytest.approx(share * 2e5, abs=1.0)


@given(st.floats(-7.0, 7.0), st.floats(-7.0, 7.0), st.floats(0.05, 1.0), st.floats(-4e4, 4e4))
def test_the_implicit_speed_solves_its_equation(wheel: float, speed: float, friction: float, pull_n: float) -> None:
    grip, rolling, per_n = friction * 3e5, 1e4, 1e-3 / 3e4
    after = carried_speed(wheel, speed, grip, 8.0, per_n, pull_n, rolling)
    force = tyre_force(wheel, after, grip, 8.0) + pull_n - rolling * max(min(after / 0.02, 1.0), -1.0)
    assert after - speed == pytest.approx(per_n * force, abs=1e-7)


def test_a_seed_makes_another_machine_within_the_spread() -> None:
    machine = replace(Machine(), spread=replace(Machine().spread, steering_gain=0.05, lags=0.1))
    bends = []
    for seed in range(4):
        vehicle = Vehicle(machine, Plane(), seed=seed)
        bends.append(drive(vehicle, at_rest(vehicle), command(0.0, 0.1), 3.25)[-1].articulation_rad)
    assert len(set(bends)) == 4
    assert np.abs(np.array(bends) / (0.1 * 2.8) - 1.0).max() < 0.06
