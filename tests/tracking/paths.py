"""Paths of the evaluation, exact: rows x, y, heading, curvature each 0.1 m, from curvatures over the way."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.messages import FloatArray

FINE_M = 0.01


def exact(curvature: FloatArray, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> FloatArray:
    """Rows each 0.1 m of a path with these curvatures each centimetre."""
    heading = start[2] + np.concatenate([[0.0], np.cumsum(0.5 * FINE_M * (curvature[1:] + curvature[:-1]))])
    middle = 0.5 * (heading[1:] + heading[:-1])
    x = start[0] + np.concatenate([[0.0], np.cumsum(FINE_M * np.cos(middle))])
    y = start[1] + np.concatenate([[0.0], np.cumsum(FINE_M * np.sin(middle))])
    rows: FloatArray = np.column_stack([x, y, heading, curvature])[::10]
    return np.ascontiguousarray(rows)


def straight(length_m: float) -> FloatArray:
    return np.zeros(round(length_m / FINE_M))


def bend(radius_m: float, turn_deg: float, ramp_m: float) -> FloatArray:
    """Curvatures of clothoid, arc, clothoid; the sign of the turn is positive to the left; a ramp of 0 is a step."""
    whole = math.radians(abs(turn_deg)) * radius_m
    ramp = min(ramp_m, whole)
    up = np.linspace(0.0, 1.0, round(ramp / FINE_M), endpoint=False)
    arc = np.ones(round((whole - ramp) / FINE_M))
    return math.copysign(1.0 / radius_m, turn_deg) * np.concatenate([up, arc, up[::-1]])


def turn(speed_mps: float, *, step: bool = False, ends_m: float = 30.0) -> FloatArray:
    """The findings' test: 90 degrees at R = max(12, v²/1.2), clothoids of 8 m at R 12, of as many seconds else."""
    radius = max(12.0, speed_mps**2 / 1.2)
    ramp = 0.0 if step else max(8.0, 2.0 * abs(speed_mps))
    return exact(np.concatenate([straight(ends_m), bend(radius, 90.0, ramp), straight(ends_m)]))


def site() -> FloatArray:
    """The paper's site: 424 m, two junctions of R 12, bends of R 60 and R 80 on the road."""
    parts = [
        straight(45.0), bend(12.0, 90.0, 8.0), straight(50.0), bend(60.0, 50.0, 16.0), straight(40.0),
        bend(80.0, -50.0, 16.0), straight(48.0), bend(12.0, -90.0, 8.0),
    ]  # fmt: skip
    made = sum(map(len, parts)) * FINE_M
    return exact(np.concatenate([*parts, straight(424.0 - made)]))
