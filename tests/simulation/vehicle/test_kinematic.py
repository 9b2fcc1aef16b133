"""The machine on open ground: circles of the closed form, slip to the outside, dead time, brake, load."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from lhdmap.machine import Machine, load_machine
from lhdmap.messages import Command
from lhdmap.resources import resource
from lhdmap.simulation.vehicle.kinematic import KinematicState, KinematicVehicle, Loader

TRUCK = load_machine(resource("pipelines/machines/truck_28t.toml"))
L0, L1 = TRUCK.dimensions.joint_to_front_axle_m, TRUCK.dimensions.joint_to_rear_axle_m
DT_S = 0.01


def _vehicle(slip: float = 0.0, machine: Machine = TRUCK) -> KinematicVehicle:
    return KinematicVehicle(machine, Loader(np.zeros((1, 2)), machine.drive.payload_kg, 10.0, 5.0), slip)


def _command(
    share: float = 0.0, rate: float = 0.0, *, brake: bool = False, tilt: float = 0.0, lift: float = 0.0
) -> Command:
    return Command(0, share, rate, tilt, lift, False, brake)


def _driven(vehicle: KinematicVehicle, state: KinematicState, command: Command, seconds: float) -> list[KinematicState]:
    states = [state]
    for _ in range(round(seconds / DT_S)):
        states.append(vehicle.step(states[-1], command, DT_S))
    return states


def test_with_the_joint_held_the_front_axle_drives_its_circle() -> None:
    """R of the front axle is (L0 cos b + L1) / sin b."""
    bend = math.radians(20.0)
    vehicle = _vehicle()
    states = _driven(vehicle, vehicle.at_rest(0.0, 0.0, 0.0)._replace(articulation_rad=bend), _command(0.2), 60.0)
    radius = (L0 * math.cos(bend) + L1) / math.sin(bend)
    late = states[3000:]
    turned = late[-1].yaw_rad - late[0].yaw_rad
    way = sum(math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) for a, b in itertools.pairwise(late))
    assert way / turned == pytest.approx(radius, rel=1e-3)


def test_slip_leads_to_the_outside() -> None:
    """With the joint held, drift to the outside makes the circle wider by no chance, and turns its course to the right."""
    bend = math.radians(10.0)
    vehicle = _vehicle(0.12)
    states = _driven(vehicle, vehicle.at_rest(0.0, 0.0, 0.0)._replace(articulation_rad=bend), _command(0.5), 20.0)
    a, b = states[-2:]
    course = math.atan2(b.y_m - a.y_m, b.x_m - a.x_m)
    lateral = b.speed_mps * (b.yaw_rad - a.yaw_rad) / DT_S
    assert b.slip_rad == pytest.approx(-0.12 * lateral / 9.81, rel=0.05)
    assert math.remainder(course - a.yaw_rad, 2.0 * math.pi) < 0.0


def test_nothing_moves_before_the_dead_time_is_over_and_the_drive_has_its_limits() -> None:
    vehicle = _vehicle()
    speeds = [one.speed_mps for one in _driven(vehicle, vehicle.at_rest(0.0, 0.0, 0.0), _command(1.0), 30.0)]
    dead = round(TRUCK.drive.dead_time_s / DT_S)
    released = dead + round(TRUCK.brakes.ramp_s / DT_S)
    assert max(speeds[: dead + 1]) == 0.0 < speeds[released]
    assert np.diff(speeds).max() / DT_S <= TRUCK.drive.acceleration_mps2 + 1e-9
    assert speeds[-1] == pytest.approx(TRUCK.dimensions.max_speed_kmh / 3.6, abs=0.01)


def test_the_brake_stops_within_its_deceleration_and_holds() -> None:
    vehicle = _vehicle()
    fast = _driven(vehicle, vehicle.at_rest(0.0, 0.0, 0.0), _command(1.0), 30.0)[-1]
    states = _driven(vehicle, fast, _command(brake=True), 8.0)
    still = next(k for k, one in enumerate(states) if one.speed_mps == 0.0)
    least_s = fast.speed_mps / (TRUCK.brakes.deceleration_mps2 + TRUCK.drive.deceleration_mps2)
    assert least_s < still * DT_S < fast.speed_mps / TRUCK.brakes.deceleration_mps2 + 1.0
    assert states[-1].speed_mps == 0.0


def test_the_joint_stays_within_its_stop() -> None:
    vehicle = _vehicle()
    states = _driven(vehicle, vehicle.at_rest(0.0, 0.0, 0.0), _command(0.1, 1.0), 10.0)
    stop = math.radians(TRUCK.dimensions.max_articulation_deg)
    assert max(one.articulation_rad for one in states) < stop + math.radians(1.0)


def test_a_load_comes_at_its_place_alone_and_goes_where_it_is_tipped() -> None:
    vehicle = _vehicle()
    full = TRUCK.drive.payload_kg
    here = _driven(vehicle, vehicle.at_rest(0.5, 0.0, 0.0), _command(lift=1.0, brake=True), 11.0)[-1]
    there = _driven(vehicle, vehicle.at_rest(5.0, 0.0, 0.0), _command(lift=1.0, brake=True), 11.0)[-1]
    assert (here.load_kg, there.load_kg) == (full, 0.0)
    half = _driven(vehicle, here, _command(tilt=-1.0, brake=True), 2.5 + TRUCK.drive.dead_time_s)[-1]
    assert half.load_kg == pytest.approx(0.5 * full, rel=0.02)
