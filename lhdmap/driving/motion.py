"""The machine's motion as control knows it, and the setpoints that control gives."""

from __future__ import annotations

from typing import NamedTuple


class Motion(NamedTuple):
    """How the machine stands and moves at `stamp_ns`: `base_link` in `odom`, joint, signed speed of the front axle."""

    stamp_ns: int
    x_m: float
    y_m: float
    heading_rad: float
    articulation_rad: float
    articulation_rate_rps: float
    speed_mps: float


class Setpoint(NamedTuple):
    """What the machine is to do from `at_ns` on: signed speed of the front axle (m/s), rate of the joint (rad/s)."""

    at_ns: int
    speed_mps: float
    steering_rate_rps: float


Setpoints = tuple[Setpoint, ...]
"""In time order; between two of them both values are interpolated."""
