"""Steering, boom and bucket against closed forms; any commands at all."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.machine import Machine
from lhdmap.machine_sections import Steering
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.driving import BOOM_RAD as BOOM_LIFT_RAD
from lhdmap.simulation.driving import BUCKET_RAD as BUCKET_TILT_RAD
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.vehicle import Vehicle

from tests.simulation.vehicle.grounds import Plane, column, command, drive, since_it_counts

MOST_RPS = math.radians(15.0)
MOST_RAD = math.radians(40.0)


def at_rest(vehicle: Vehicle) -> VehicleState:
    return vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, time_ns=0)


def lagged(t: FloatArray, rate: float, lag_s: float = 0.2) -> FloatArray:
    """Angle of a joint whose rate goes to `rate` from nought at t = 0."""
    after = np.maximum(t, 0.0)
    angle: FloatArray = rate * (after + lag_s * np.expm1(-after / lag_s))
    return angle


@pytest.mark.parametrize("rate_rps", [0.1, -0.2])
def test_the_joint_follows_a_step_after_the_dead_time(rate_rps: float) -> None:
    vehicle = Vehicle(Machine(), Plane())
    states = drive(vehicle, at_rest(vehicle), command(0.2, rate_rps), 2.5)
    t = since_it_counts(states)
    assert np.abs(column(states, "articulation_rad") - lagged(t, rate_rps)).max() < 1e-9
    wanted = rate_rps * -np.expm1(-np.maximum(t, 0.0) / 0.2)
    assert np.abs(column(states, "articulation_rate_rps") - wanted).max() < 1e-9


def test_a_pulse_acts_for_as_long_as_it_was_given() -> None:
    vehicle = Vehicle(Machine(), Plane())
    states = drive(vehicle, at_rest(vehicle), lambda t: command(0.0, 0.1 if t < 0.1 else 0.0), 2.0)
    assert states[-1].articulation_rad == pytest.approx(0.1 * 0.1, abs=1e-5)
    assert len(states[-1].pending) == 1


def test_the_rate_is_limited() -> None:
    vehicle = Vehicle(Machine(), Plane())
    states = drive(vehicle, at_rest(vehicle), command(0.0, 3.0), 2.5)
    t = since_it_counts(states)
    assert np.abs(column(states, "articulation_rad") - lagged(t, MOST_RPS)).max() < 1e-9


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_joint_has_hard_stops_and_leaves_them(way: float) -> None:
    vehicle = Vehicle(Machine(), Plane())
    states = drive(vehicle, at_rest(vehicle), command(0.0, way), 5.0)
    assert states[-1].articulation_rad == way * MOST_RAD
    assert states[-1].articulation_rate_rps == 0.0
    back = drive(vehicle, states[-1], command(0.0, -way * 0.1), 1.25)
    assert back[-1].articulation_rad == pytest.approx(way * (MOST_RAD - lagged(np.array(1.0), 0.1)), abs=1e-9)


def test_dead_zone_and_gain() -> None:
    machine = replace(Machine(), steering=Steering(gain=0.9, dead_zone_dps=1.0))
    vehicle = Vehicle(machine, Plane())
    assert drive(vehicle, at_rest(vehicle), command(0.0, math.radians(0.9)), 2.0)[-1].articulation_rad == 0.0
    end = drive(vehicle, at_rest(vehicle), command(0.0, 0.1), 2.25)[-1]
    assert end.articulation_rad == pytest.approx(float(lagged(np.array(2.0), 0.09)), abs=1e-9)


def test_it_starts_in_tramming_posture() -> None:
    state = at_rest(Vehicle(Machine(), Plane()))
    assert (state.boom_rad, state.bucket_rad) == (BOOM_LIFT_RAD, BUCKET_TILT_RAD)


@pytest.mark.parametrize(("rpm", "share"), [(True, 1.0), (False, 0.6)])
@pytest.mark.parametrize("both", [True, False])
def test_boom_and_bucket_move_at_their_rates(rpm: bool, share: float, both: bool) -> None:
    vehicle = Vehicle(Machine(), Plane())
    tilt, share = (-1.0, 0.6 * share) if both else (0.0, share)
    states = drive(vehicle, at_rest(vehicle), command(lift=1.0, tilt=tilt, rpm=rpm), 4.0)
    t = since_it_counts(states)
    assert np.abs(column(states, "boom_rad") - BOOM_LIFT_RAD - lagged(t, 0.16 * share)).max() < 1e-9
    assert np.abs(column(states, "bucket_rad") - BUCKET_TILT_RAD - lagged(t, 0.24 * share * tilt)).max() < 1e-9


def test_a_bucket_against_its_stop_strains_the_cylinder() -> None:
    vehicle = Vehicle(Machine(), Plane())
    states = drive(vehicle, at_rest(vehicle), command(tilt=0.8), 3.0)
    assert states[-1].bucket_rad == BUCKET_TILT_RAD
    assert states[-1].curl == pytest.approx(0.8, abs=1e-3)
    free = drive(vehicle, states[-1], command(tilt=-0.8), 3.0)
    assert free[-1].curl == pytest.approx(0.0, abs=1e-3)


number = st.one_of(st.floats(-3.0, 3.0), st.sampled_from([0.0, 1.0, -1.0, math.nan, math.inf, -math.inf]))
commands = st.builds(Command, st.just(0), number, number, number, number, st.booleans(), st.booleans())
planes = st.builds(Plane, st.floats(-0.2, 0.2), st.floats(-0.1, 0.1), st.floats(0.0, 0.9))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(commands, st.integers(1, 80)), min_size=1, max_size=8), planes, st.floats(0.0, 15e3))
def test_any_commands_leave_the_state_finite_and_within_its_limits(
    run: list[tuple[Command, int]], plane: Plane, load_kg: float
) -> None:
    machine = Machine()
    vehicle = Vehicle(machine, plane)
    state = vehicle.at_rest(2.0, -1.0, 0.5, near_z_m=0.0, load_kg=load_kg, time_ns=0)
    for given_now, steps in run:
        for _ in range(steps):
            state = vehicle.step(state, given_now, 0.02)
            assert np.isfinite(state[:19]).all()
            assert abs(state.articulation_rad) <= MOST_RAD
            assert abs(state.articulation_rate_rps) <= MOST_RPS + 1e-12
            assert abs(state.wheel_speed_mps) < 40.0
            assert 0.0 <= state.boom_rad <= 1.2
            assert -2.2 <= state.bucket_rad <= 0.0
            assert 0.0 <= state.brake <= 1.0
            assert 0.0 <= state.curl <= 1.0
            assert abs(state.traction_mps2) <= 9.81 * max(plane.mu, 1e-3) + 1e-6


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(commands, st.integers(1, 60)), min_size=1, max_size=6), planes)
def test_two_half_steps_are_one_step(run: list[tuple[Command, int]], plane: Plane) -> None:
    vehicle = Vehicle(Machine(), plane)
    whole = halves = vehicle.at_rest(0.0, 0.0, 1.0, near_z_m=0.0, articulation_rad=0.2, time_ns=0)
    for given_now, steps in run:
        for _ in range(steps):
            whole = vehicle.step(whole, given_now, 0.02)
            halves = vehicle.step(vehicle.step(halves, given_now, 0.01), given_now, 0.01)
    assert np.abs(np.array(whole[:19]) - np.array(halves[:19])).max() < 1e-6
