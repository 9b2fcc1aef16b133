"""Paths of the stepped machine against closed forms: circles, clothoids, poses on the floor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se3
from lhdmap.kinematics import T_base_rear, articulation_for_curvature
from lhdmap.machine import Dimensions, Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.vehicle.vehicle import Vehicle
from scipy.integrate import quad, solve_ivp

from tests.simulation.vehicle.grounds import STEP_S, Plane, Waves, column, command, drive

UNEVEN = Machine(dimensions=Dimensions(joint_to_front_axle_m=1.4, joint_to_rear_axle_m=2.1))


@pytest.mark.parametrize("bend_rad", [-0.65, 0.2, 0.6])
@pytest.mark.parametrize("propel", [0.35, -0.35])
def test_a_held_joint_drives_a_circle(bend_rad: float, propel: float) -> None:
    vehicle = Vehicle(UNEVEN, Plane())
    start = vehicle.at_rest(3.0, -2.0, 0.7, near_z_m=0.0, articulation_rad=bend_rad, time_ns=0)
    states = drive(vehicle, start, command(propel), 40.0)
    radius = (1.4 * math.cos(bend_rad) + 2.1) / math.sin(bend_rad)
    x, y, yaw, speed = (column(states, name) for name in ("x_m", "y_m", "yaw_rad", "speed_mps"))
    wanted = [3.0 + radius * (np.sin(yaw) - math.sin(0.7)), -2.0 - radius * (np.cos(yaw) - math.cos(0.7))]
    assert np.hypot(x - wanted[0], y - wanted[1]).max() < 1e-3
    driven = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * STEP_S])
    assert np.abs((yaw - 0.7) * radius - driven).max() < 1e-3
    assert abs(driven[-1]) > 80.0


def test_the_circle_of_a_curvature_closes_after_a_turn() -> None:
    vehicle = Vehicle(Machine(), Plane())
    bend = articulation_for_curvature(1.0 / 8.0, Machine())
    states = drive(
        vehicle, vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, articulation_rad=bend, time_ns=0), command(0.5), 22.0
    )
    yaw = column(states, "yaw_rad")
    k = int(np.argmax(yaw > 2.0 * math.pi))
    assert math.hypot(states[k].x_m, states[k].y_m - 8.0) == pytest.approx(8.0, abs=1e-3)
    assert states[k].x_m == pytest.approx(8.0 * math.sin(yaw[k]), abs=1e-3)


@pytest.mark.parametrize("rate_pm2", [0.008, -0.004])
def test_a_clothoid_is_driven_to_the_millimetre(rate_pm2: float) -> None:
    """The joint is commanded as Eq. (1) wants it on a path of linear curvature, with what undoes lag and dead time."""
    machine, speed = UNEVEN, 3.0
    vehicle = Vehicle(machine, Plane())
    start = drive(
        vehicle, vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, time_ns=0), command(speed / (24.0 / 3.6)), 15.0
    )[-1]
    speed = start.speed_mps
    front_m, rear_m, length_m = 1.4, 2.1, 16.0

    def slope(s: float, bend: float) -> float:
        return (rate_pm2 * s * (front_m * math.cos(bend) + rear_m) - math.sin(bend)) / rear_m

    path = solve_ivp(
        lambda s, g: [slope(s, g[0])], (0.0, length_m + 6.0), [0.0], rtol=1e-10, atol=1e-12, dense_output=True
    )

    def joint(t: float) -> float:
        return float(path.sol(max(speed * t, 0.0))[0])

    def wanted(t: float) -> float:
        h = 1e-3
        rate, bow = (joint(t + h) - joint(t - h)) / (2 * h), (joint(t + h) - 2 * joint(t) + joint(t - h)) / (h * h)
        return rate + machine.steering.lag_s * bow

    states = drive(vehicle, start, lambda t: command(3.0 / (24.0 / 3.6), wanted(t)), length_m / speed + 0.25)
    way = np.maximum(np.arange(len(states)) * STEP_S - 0.25, 0.0) * speed
    begin = start.x_m + 0.25 * speed
    for k in range(0, len(states), 20):
        x, y = _clothoid(rate_pm2, way[k]) if way[k] > 0.0 else (states[k].x_m - begin, 0.0)
        assert math.hypot(states[k].x_m - begin - x, states[k].y_m - y) < 1e-3
    assert abs(states[-1].yaw_rad - 0.5 * rate_pm2 * way[-1] ** 2) < 2e-4
    assert abs(states[-1].yaw_rad) > 0.4


def _clothoid(rate_pm2: float, s: float) -> tuple[float, float]:
    """Fresnel's integrals, by quadrature."""
    return (
        quad(lambda u: math.cos(0.5 * rate_pm2 * u * u), 0.0, s)[0],
        quad(lambda u: math.sin(0.5 * rate_pm2 * u * u), 0.0, s)[0],
    )


def test_turning_the_joint_at_rest_turns_both_bodies() -> None:
    """With the front axle standing, Eq. (1) is integrable: dyaw = L_r dγ / (L_f cos γ + L_r)."""
    vehicle = Vehicle(UNEVEN, Plane())
    end = drive(vehicle, vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, time_ns=0), command(0.0, 0.2), 2.0)[-1]
    turned = quad(lambda bend: 2.1 / (1.4 * math.cos(bend) + 2.1), 0.0, end.articulation_rad)[0]
    assert end.articulation_rad > 0.3
    assert end.yaw_rad == pytest.approx(turned, abs=1e-6)
    assert (end.x_m, end.y_m) == (0.0, 0.0)


def test_a_circle_on_a_slope_stays_in_its_plane() -> None:
    """On a tilted plane the machine turns about the plane's normal: seen along it the path is the same circle."""
    plane = Plane(0.1, -0.06)
    vehicle = Vehicle(Machine(), plane)
    bend = articulation_for_curvature(0.1, Machine())
    states = drive(
        vehicle, vehicle.at_rest(0.0, 0.0, 0.3, near_z_m=0.0, articulation_rad=bend, time_ns=0), command(0.3), 30.0
    )
    poses = np.stack([_pose(np.array(state[1:7])) for state in states])
    centre = poses[:, :3, 3] + 10.0 * poses[:, :3, 1]
    assert np.ptp(centre, axis=0).max() < 1e-3
    normal = np.array([-plane.along, -plane.across, 1.0])
    assert np.abs(poses[:, :3, 2] - normal / np.linalg.norm(normal)).max() < 1e-9
    assert column(states, "yaw_rad")[-1] > 2.0 * math.pi * 0.7


def _pose(row: FloatArray) -> FloatArray:
    return se3.from_rpy(row[3], row[4], row[5], (row[0], row[1], row[2]))


@pytest.mark.parametrize("level", [0, 1])
def test_wheels_stand_on_the_floor_of_their_level(level: int) -> None:
    """The plane goes through the mean floor under both front tyres and the middle of the rear ones."""
    machine, ground = Machine(), Waves()
    state = Vehicle(machine, ground).at_rest(4.0, 1.0, 0.6, near_z_m=5.0 * level, articulation_rad=0.4, time_ns=0)
    T = _pose(np.array(state[1:7]))

    def tyre(T_map_axle: FloatArray, side_m: float) -> FloatArray:
        offsets = np.array([(u, side_m + w, 0.0, 1.0) for u in (-0.25, 0.0, 0.25) for w in (-0.25, 0.0, 0.25)])
        points = (offsets @ T_map_axle.T)[:, :3] + [0.0, 0.0, 5.0 * level - T_map_axle[2, 3]]
        return np.append(points[:, :2].mean(axis=0), ground.floor_height(points).mean())

    flat = se3.from_rpy(0.0, 0.0, 0.6, (4.0, 1.0, 0.0))
    rear = flat @ T_base_rear(0.4, machine)
    contacts = [tyre(flat, 0.95), tyre(flat, -0.95), 0.5 * (tyre(rear, 0.95) + tyre(rear, -0.95))]
    for contact in contacts:
        assert T[:3, 2] @ (contact - T[:3, 3]) == pytest.approx(0.0, abs=2e-3)
    assert state.z_m == pytest.approx(0.5 * (contacts[0][2] + contacts[1][2]), abs=1e-9)
    assert state.z_m > 4.0 * level - 0.5
    assert abs(state.pitch_rad) > 0.01


def test_a_hole_in_the_floor_is_driven_over() -> None:
    class Hole(Plane):
        def floor_height(self, points_m: FloatArray) -> FloatArray:
            return np.where(points_m[:, 0] > 3.0, np.nan, 0.1 * points_m[:, 0])

    vehicle = Vehicle(Machine(), Hole())
    end = drive(vehicle, vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, time_ns=0), command(0.4), 6.0)[-1]
    assert end.x_m > 8.0
    assert end.z_m == pytest.approx(0.1 * end.x_m, abs=1e-6)


def test_a_row_of_the_history_is_the_state() -> None:
    vehicle = Vehicle(Machine(), Plane())
    state = drive(
        vehicle, vehicle.at_rest(1.0, 2.0, 0.3, near_z_m=0.0, load_kg=500.0, time_ns=7), command(0.5, 0.1), 1.0
    )[-1]
    row = state.row()
    assert row.shape == (20,)
    assert row[:9].tolist() == [
        state.x_m, state.y_m, state.z_m, state.roll_rad, state.pitch_rad, state.yaw_rad,
        state.articulation_rad, state.speed_mps, state.wheel_speed_mps,
    ]  # fmt: skip
    assert row[15] == 500.0
    assert state.time_ns == 1_000_000_007
