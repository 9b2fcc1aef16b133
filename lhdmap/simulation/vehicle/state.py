"""The state of a stepped machine at one moment."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import Command, FloatArray


class VehicleState(NamedTuple):
    """All that a stepped machine is at one moment; SI, `base_link` in `map`, yaw continuous.

    The numbers are in the order of `lhdmap.simulation.history.Column`; `brake` (0 to 1) is what the brake really does.
    `pending`: the command in force and those whose dead time has not passed, each with the time from which it counts.
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

    @property
    def position_m(self) -> FloatArray:
        """Position of `base_link` in `map`, shape (3,)."""
        return np.array(self[1:4])

    def row(self) -> FloatArray:
        """Return the row of a `History`, shape (17,)."""
        return np.array(self[1:18])
