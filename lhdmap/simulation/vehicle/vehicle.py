"""The machine that is stepped: commands in, state out."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.surroundings import Ground
from lhdmap.simulation.vehicle import kernel
from lhdmap.simulation.vehicle.plant import Plant, drawn_errors, plant_of
from lhdmap.simulation.vehicle.state import VehicleState, state_of_row

SUB_STEP_S = 0.001
ROW = kernel.BRAKE + 1  # of a row of the kernel
_LEAST_FRICTION = 1e-3

Pending = tuple[tuple[int, Command], ...]


class Vehicle:
    """A machine on a floor; it has no state of its own, so that any state can be stepped again.

    `seed` decides how far this machine is from its file (`[spread]`).
    """

    def __init__(self, machine: Machine, ground: Ground, *, seed: int = 0) -> None:
        self.machine, self._ground = machine, ground
        self._errors = drawn_errors(machine.spread, seed)
        self._plant, self._load_kg = plant_of(machine, 0.0, self._errors), 0.0
        self._dead_ns = round(machine.drive.dead_time_s * 1e9)

    def at_rest(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: float,
        *,
        near_z_m: float,
        articulation_rad: float = 0.0,
        load_kg: float = 0.0,
        time_ns: int,
    ) -> VehicleState:
        """Return the machine standing at a place, in tramming posture, held by its drive; `near_z_m` says on which level."""
        linkage, plant = self.machine.linkage, self._plant_with(load_kg)
        row = np.zeros(ROW)
        row[:7] = x_m, y_m, near_z_m, 0.0, 0.0, yaw_rad, articulation_rad
        row[10:12], row[15] = (linkage.boom_min_rad, linkage.bucket_max_rad), load_kg
        for _ in range(3):  # z of the points says which level: from the plane that was found
            points = kernel.points_at_rest(row, plant)
            kernel.stand(row, plant, points, self._ground.floor_height(points))
        still = Command(time_ns, 0.0, 0.0, 0.0, 0.0, full_rpm=False, brake=False)
        return state_of_row(time_ns, row, ((time_ns, still),))

    def step(self, state: VehicleState, command: Command, dt_s: float) -> VehicleState:
        """Return the state after `dt_s` with a command given now: it counts when its dead time has passed."""
        now_ns = state.time_ns
        end_ns = now_ns + round(dt_s * 1e9)
        pending = queued(state.pending, now_ns, now_ns + self._dead_ns, command)
        commands, since_s = in_force(pending, now_ns, end_ns)
        plant, row = self._plant_with(state.load_kg), np.array(state[1 : 1 + ROW])
        friction = max(self._ground.friction(row[:3]), _LEAST_FRICTION)
        steps = max(1, math.ceil(dt_s / SUB_STEP_S - 1e-6))
        points = kernel.advance(row, plant, commands, since_s, steps, dt_s / steps, friction)
        kernel.stand(row, plant, points, self._ground.floor_height(points))
        return state_of_row(end_ns, row, pending)

    def _plant_with(self, load_kg: float) -> Plant:
        if load_kg != self._load_kg:
            self._plant, self._load_kg = plant_of(self.machine, load_kg, self._errors), load_kg
        return self._plant


def queued(pending: Pending, now_ns: int, counts_ns: int, command: Command) -> Pending:
    """Return the command in force and those to come; one that says the same as the one before it is none."""
    first = 0
    while first + 1 < len(pending) and pending[first + 1][0] <= now_ns:
        first += 1
    kept = pending[first:] if first else pending
    return kept if kept[-1][1][1:] == command[1:] else (*kept, (counts_ns, command))


def in_force(pending: Pending, now_ns: int, end_ns: int) -> tuple[FloatArray, FloatArray]:
    """Return the commands that count during a step, shape (K, 6), and from when (K,), s; the first from before."""
    due = [one for one in pending if one[0] < end_ns]
    since = np.array([(one[0] - now_ns) * 1e-9 for one in due])
    return np.array([within(one[1]) for one in due]), since


def within(command: Command) -> tuple[float, ...]:
    """Return a command as numbers, within its range; what is no number is none."""
    _, propel, steering, tilt, lift, full_rpm, brake = command
    return _share(propel), (steering if math.isfinite(steering) else 0.0), _share(tilt), _share(lift), full_rpm, brake


def _share(value: float) -> float:
    return min(max(value, -1.0), 1.0) if math.isfinite(value) else 0.0
