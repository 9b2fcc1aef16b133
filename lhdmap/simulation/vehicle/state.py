"""The state of a stepped machine at one moment."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import Command, FloatArray


class Digging(NamedTuple):
    """What a machine that digs is beside its pose and speeds.

    `bucket` is the state of the side view while the bucket is lowered or in the pile (`lhdmap.simulation.ground.records`);
    `rocking` and its rate how far the lift pressure swings, of itself; `lifted` the way that the boom last moved (1, -1).
    """

    bucket: tuple[float, ...] | None = None
    rocking: float = 0.0
    rocking_rate: float = 0.0
    lifted: float = 0.0
    session: int = 0


class VehicleState(NamedTuple):
    """All that a stepped machine is at one moment; SI, `base_link` in `map`, yaw continuous.

    The numbers are in the order of `lhdmap.simulation.history.Column`; `brake` (0 to 1) is what the brake really does.
    `pending`: the command in force and those whose dead time has not passed, each with the time from which it counts.
    Pressures are those of a machine that reckons them (`LoadingVehicle`), else 0; `digging` is the rest of its state.
    """

    time_ns: int
    x_m: float
    y_m: float
    z_m: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    articulation_rad: float
    speed_mps: float
    wheel_speed_mps: float
    articulation_rate_rps: float
    boom_rad: float
    bucket_rad: float
    boom_rate_rps: float
    bucket_rate_rps: float
    traction_mps2: float
    load_kg: float
    curl: float
    brake: float
    pending: tuple[tuple[int, Command], ...]
    transmission_bar: float = 0.0
    lift_bar: float = 0.0
    tilt_bar: float = 0.0
    digging: Digging | None = None

    @property
    def position_m(self) -> FloatArray:
        """Position of `base_link` in `map`, shape (3,)."""
        return np.array(self[1:4])

    def row(self) -> FloatArray:
        """Return the row of a `History`, shape (20,)."""
        return np.array((*self[1:18], self.transmission_bar, self.lift_bar, self.tilt_bar))


def state_of_row(time_ns: int, row: FloatArray, pending: tuple[tuple[int, Command], ...]) -> VehicleState:
    """Return the state of a row (18,) of the kernel; it reckons no pressures."""
    return VehicleState._make((time_ns, *row.tolist(), pending, 0.0, 0.0, 0.0, None))
