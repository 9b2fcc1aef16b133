"""The state of a stepped machine at one moment."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import Command, FloatArray

BOOM_LIFT_RAD, BUCKET_TILT_RAD = -0.35, 0.6
"""Tramming posture: boom down, bucket racked."""


class VehicleState(NamedTuple):
    """Pose of `base_link` in `map` (yaw continuous), joints, speeds and forces, SI units; columns as in a `History`.

    `traction_mps2` is what the wheels' force accelerates the machine by, signed along x; `brake` is what the brakes do now
    (0 … 1). `pending` are commands that have not taken effect yet, with the time when they do.
    """

    time_ns: int
    x_m: float
    y_m: float
    z_m: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    articulation_rad: float
    articulation_rate_rps: float
    speed_mps: float
    wheel_speed_mps: float
    traction_mps2: float
    brake: float
    boom_rad: float
    boom_rate_rps: float
    bucket_rad: float
    bucket_rate_rps: float
    load_kg: float
    curl: float
    pending: tuple[tuple[int, Command], ...]
    command: Command

    def row(self) -> FloatArray:
        """Return the state as a row of a `History`, shape (17,)."""
        return np.array(
            [
                self.x_m, self.y_m, self.z_m, self.roll_rad, self.pitch_rad, self.yaw_rad, self.articulation_rad,
                self.speed_mps, self.wheel_speed_mps, self.articulation_rate_rps, self.boom_rad, self.bucket_rad,
                self.boom_rate_rps, self.bucket_rate_rps, self.traction_mps2, self.load_kg, self.curl,
            ]
        )  # fmt: skip

    @property
    def position_m(self) -> FloatArray:
        """Position of `base_link` in `map`, shape (3,)."""
        return np.array([self.x_m, self.y_m, self.z_m])
