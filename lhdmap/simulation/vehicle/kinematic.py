"""A machine on open ground, by its kinematics: slip at both axles, lags, dead time; no tyres, no roll, no grade.

It is what path tracking is tried on where no mine is around (haulage findings, section 2): both axles drift to the outside of a
bend by so many radians per g, as they do above 15 km/h.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.geometry.articulated import rear_axle
from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.history import SECOND_NS, START_NS, Column
from lhdmap.tracking.kernel import moved, rear_speed

_GRAVITY = 9.81
_SLIP_LAG_S = 0.1
_AT_PLACE_M, _STANDS_MPS = 1.5, 0.05


class KinematicState(NamedTuple):
    """What the machine is at one moment; SI, `base_link` in `map`. `slip_rad`: of both axles, from heading to course.

    `pending`: commands whose dead time has not passed, and the one in force, each with the time from which it counts.
    """

    time_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    articulation_rad: float = 0.0
    articulation_rate_rps: float = 0.0
    speed_mps: float = 0.0
    slip_rad: float = 0.0
    load_kg: float = 0.0
    brake: float = 0.0
    pending: tuple[tuple[int, Command], ...] = ()
    z_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    def row(self) -> FloatArray:
        """Return the row of a `History`, shape (20,)."""
        row = np.zeros(len(Column))
        row[Column.X], row[Column.Y], row[Column.YAW] = self.x_m, self.y_m, self.yaw_rad
        row[Column.ARTICULATION], row[Column.ARTICULATION_RATE] = self.articulation_rad, self.articulation_rate_rps
        row[Column.SPEED] = row[Column.WHEEL_SPEED] = self.speed_mps
        row[Column.LOAD] = self.load_kg
        return row

    def rear(self, model: DriveModel) -> tuple[float, float, float, float, float]:
        """Return x, y and heading of the rear axle, the joint's angle and rate."""
        bend_rad = self.articulation_rad
        x, y, back = rear_axle(self.x_m, self.y_m, self.yaw_rad, bend_rad, model.front_m, model.rear_m)
        return x, y, back, bend_rad, self.articulation_rate_rps


class Loader(NamedTuple):
    """Who fills the machine where it stands at one of `places_m` (N, 2), and how long a full load takes to come and go."""

    places_m: FloatArray
    full_kg: float
    load_s: float
    dump_s: float


class KinematicVehicle:
    """Steps the state: `propel` is a share of the top speed, `lift` > 0 asks to be loaded, `tilt` < 0 dumps."""

    def __init__(self, machine: Machine, loader: Loader, slip_rad_per_g: float) -> None:
        self._empty, self._loaded = drive_model(machine), drive_model(machine, loader.full_kg)
        self._loader, self._slip_per_g = loader, slip_rad_per_g
        self._top_mps = machine.dimensions.max_speed_kmh / 3.6

    def at_rest(self, x_m: float, y_m: float, heading_rad: float) -> KinematicState:
        """Return a machine that stands straight and empty at the start of the clock."""
        return KinematicState(START_NS, x_m, y_m, heading_rad)

    def step(self, state: KinematicState, command: Command, dt_s: float) -> KinematicState:
        """Return the state a moment later."""
        full, model = state.load_kg > 0.5 * self._loader.full_kg, self._empty
        model = self._loaded if full else model
        pending = (*state.pending, (state.time_ns + round(model.dead_time_s * SECOND_NS), command))
        while len(pending) > 1 and pending[1][0] <= state.time_ns:
            pending = pending[1:]
        held = pending[0][1] if pending[0][0] <= state.time_ns else None
        rate = _within(0.0 if held is None else held.steering_rate_rps, model.max_rate_rps)
        speed, brake = self._driven(state, held, model, dt_s)
        lengths = (model.front_m, model.rear_m, model.steering_lag_s)
        x, y, back, bend, turns = state.rear(model)
        if abs(bend) >= model.max_articulation_rad and rate * bend > 0.0:
            rate, bend, turns = 0.0, math.copysign(model.max_articulation_rad, bend), 0.0
        rear = rear_speed(speed, bend, turns, lengths)
        slips = (state.slip_rad, state.slip_rad)
        x, y, after, bend, turns = moved((x, y, back, bend, turns), rear, rate, dt_s, lengths, slips)
        lateral = rear * (after - back) / dt_s
        slip = state.slip_rad + (-self._slip_per_g * lateral / _GRAVITY - state.slip_rad) * dt_s / _SLIP_LAG_S
        ahead = after + bend
        return KinematicState(
            state.time_ns + round(dt_s * SECOND_NS),
            x + model.rear_m * math.cos(after) + model.front_m * math.cos(ahead),
            y + model.rear_m * math.sin(after) + model.front_m * math.sin(ahead),
            ahead, bend, turns, speed, slip, self._load_kg(state, held, dt_s), brake, pending,
        )  # fmt: skip

    def _driven(
        self, state: KinematicState, held: Command | None, model: DriveModel, dt_s: float
    ) -> tuple[float, float]:
        """Return speed and brake a moment later."""
        brakes = held is None or held.brake
        ramp = dt_s / max(model.brake_ramp_s, dt_s)
        brake = min(state.brake + ramp, 1.0) if brakes else max(state.brake - ramp, 0.0)
        wanted = 0.0 if held is None or brakes else held.propel * self._top_mps
        change = (wanted - state.speed_mps) * -math.expm1(-dt_s / model.drive_lag_s)
        most = model.acceleration_mps2 if state.speed_mps * change >= 0.0 else model.deceleration_mps2
        speed = state.speed_mps + _within(change, most * dt_s)
        return speed - _within(speed, brake * model.brake_mps2 * dt_s), brake

    def _load_kg(self, state: KinematicState, held: Command | None, dt_s: float) -> float:
        one = self._loader
        if held is None or abs(state.speed_mps) > _STANDS_MPS:
            return state.load_kg
        if held.tilt < 0.0:
            return max(state.load_kg - one.full_kg * dt_s / one.dump_s, 0.0)
        if held.lift > 0.0 and np.hypot(*(one.places_m - (state.x_m, state.y_m)).T).min() < _AT_PLACE_M:
            return min(state.load_kg + one.full_kg * dt_s / one.load_s, one.full_kg)
        return state.load_kg


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)
