"""`Vehicle.step(state, command, dt_s)`: the machine a moment later, on the floor of a world."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.surroundings import Ground
from lhdmap.simulation.vehicle import motion
from lhdmap.simulation.vehicle.state import BOOM_LIFT_RAD, BUCKET_TILT_RAD, VehicleState

_FOOTPRINT_M = 0.25  # half length and width of the patch under a tyre that carries it
_PATCH = np.array([[a, b] for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)]) * _FOOTPRINT_M
_FRICTION_EVERY_M = 0.5


class Vehicle:
    """A machine over a floor. Each step follows from state and command alone; what the world is asked for is kept nearby."""

    def __init__(self, machine: Machine, ground: Ground) -> None:
        self.machine, self._ground = machine, ground
        self._dead_ns = round(machine.drive.dead_time_s * 1e9)
        self._parameters = (-1.0, motion.parameters(machine, 0.0))
        self._friction = (np.full(3, np.inf), 0.6)

    def at_rest(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: float,
        *,
        near_z_m: float,
        time_ns: int,
        articulation_rad: float = 0.0,
        load_kg: float = 0.0,
    ) -> VehicleState:
        """Return the state of a machine that stands, near a height that says which level it is on."""
        z, roll, pitch = self._attitude(x_m, y_m, near_z_m, yaw_rad, articulation_rad)
        none = Command(time_ns, 0.0, 0.0, 0.0, 0.0, False, True)
        return VehicleState(
            time_ns, x_m, y_m, z, roll, pitch, yaw_rad, articulation_rad, 0.0, 0.0, 0.0, 0.0, 1.0,
            BOOM_LIFT_RAD, 0.0, BUCKET_TILT_RAD, 0.0, load_kg, 0.0, (), none,
        )  # fmt: skip

    def step(self, state: VehicleState, command: Command | None, dt_s: float) -> VehicleState:
        """Return the state `dt_s` later; a command takes effect after the dead time, None goes on with the last one."""
        pending = state.pending if command is None else (*state.pending, (state.time_ns + self._dead_ns, command))
        now_ns, end_ns = state.time_ns, state.time_ns + round(dt_s * 1e9)
        values = _values(state)
        ground = np.array([-state.pitch_rad, self._friction_at(state.position_m)])
        parameters = self._parameters_for(state.load_kg)
        active = state.command
        while True:
            while pending and pending[0][0] <= now_ns:
                active, pending = pending[0][1], pending[1:]
            until_ns = min(end_ns, pending[0][0]) if pending else end_ns
            if until_ns > now_ns:
                motion.advance(values, _told(active), parameters, ground, (until_ns - now_ns) * 1e-9)
            now_ns = until_ns
            if now_ns >= end_ns:
                break
        return self._moved(state, values, end_ns, pending, active)

    def _moved(
        self,
        state: VehicleState,
        values: FloatArray,
        time_ns: int,
        pending: tuple[tuple[int, Command], ...],
        active: Command,
    ) -> VehicleState:
        x, y, yaw, bend, bend_rate, speed, wheel, traction, brake, boom, boom_rate, bucket, bucket_rate = (
            values.tolist()
        )
        z, roll, pitch = self._attitude(x, y, state.z_m, yaw, bend)
        return VehicleState(
            time_ns, x, y, z, roll, pitch, yaw, bend, bend_rate, speed, wheel, traction, brake,
            boom, boom_rate, bucket, bucket_rate, state.load_kg, state.curl, pending, active,
        )  # fmt: skip

    def _parameters_for(self, load_kg: float) -> FloatArray:
        if self._parameters[0] != load_kg:
            self._parameters = (load_kg, motion.parameters(self.machine, load_kg))
        return self._parameters[1]

    def _friction_at(self, position_m: FloatArray) -> float:
        """Return the friction here; within half a metre of where it was asked for last, that of there."""
        cell = np.round(position_m / _FRICTION_EVERY_M)
        if not np.array_equal(cell, self._friction[0]):
            self._friction = (cell, self._ground.friction(cell * _FRICTION_EVERY_M))
        return self._friction[1]

    def _attitude(self, x: float, y: float, z: float, yaw: float, bend: float) -> tuple[float, float, float]:
        """Return height, roll and pitch: those of the plane through both front wheels and the middle of the rear axle."""
        size = self.machine.dimensions
        half, s, c = 0.5 * size.track_m, math.sin(bend), math.cos(bend)
        rear_x = -size.joint_to_front_axle_m - size.joint_to_rear_axle_m * c
        rear_y = size.joint_to_rear_axle_m * s
        wheels = np.array(
            [[0.0, half], [0.0, -half], [rear_x + half * s, rear_y + half * c], [rear_x - half * s, rear_y - half * c]]
        )
        patches = (wheels[:, None, :] + _PATCH).reshape(-1, 2)
        cy, sy = math.cos(yaw), math.sin(yaw)
        points = np.empty((len(patches), 3))
        points[:, 0] = x + cy * patches[:, 0] - sy * patches[:, 1]
        points[:, 1] = y + sy * patches[:, 0] + cy * patches[:, 1]
        points[:, 2] = z
        left, right, back_left, back_right = self._ground.floor_height(points).reshape(4, -1).mean(axis=1).tolist()
        height, cross = 0.5 * (left + right), (left - right) / size.track_m
        slope = (0.5 * (back_left + back_right) - height - cross * rear_y) / rear_x
        pitch = -math.atan(slope)
        return height, math.atan(cross * math.cos(pitch)), pitch


def _values(state: VehicleState) -> FloatArray:
    return np.array(
        [
            state.x_m, state.y_m, state.yaw_rad, state.articulation_rad, state.articulation_rate_rps, state.speed_mps,
            state.wheel_speed_mps, state.traction_mps2, state.brake, state.boom_rad, state.boom_rate_rps, state.bucket_rad,
            state.bucket_rate_rps,
        ]
    )  # fmt: skip


def _told(command: Command) -> FloatArray:
    return np.array(
        [
            command.propel, command.steering_rate_rps, command.tilt, command.lift, float(command.full_rpm),
            float(command.brake),
        ]
    )  # fmt: skip
