"""Deliberative path planning (Section 3.4.2): a cubic from the leading axle to a target pose, and the rate that it asks for."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray


class Spline(NamedTuple):
    """S(t) for t in [0, t_end]: coefficients (4, 2), highest power last; Eqs. (7) and (8)."""

    coefficients: FloatArray
    t_end: float

    def at(self, t: FloatArray) -> FloatArray:
        """Return places (N, 2)."""
        powers = np.stack([np.ones_like(t), t, t**2, t**3], axis=-1)
        places: FloatArray = powers @ self.coefficients
        return places

    def curvature(self, t: FloatArray) -> FloatArray:
        """Return signed curvatures (N,), 1/m."""
        first = np.stack([np.zeros_like(t), np.ones_like(t), 2 * t, 3 * t**2], axis=-1) @ self.coefficients
        second = np.stack([np.zeros_like(t), np.zeros_like(t), 2 * np.ones_like(t), 6 * t], axis=-1) @ self.coefficients
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        curvature: FloatArray = cross / np.maximum(np.linalg.norm(first, axis=1), 1e-9) ** 3
        return curvature


def spline_to(start: FloatArray, target: FloatArray, speed_mps: float) -> Spline:
    """Return the cubic between two poses (3,): place and course at both ends, at one speed, in the time of the chord.

    The paper prints the start's velocity as v (cos γ, sin γ); here it is along the heading of the leading body.

    Raises:
        ValueError: start and target are one place, or the speed is none.
    """
    far = math.dist(start[:2], target[:2])
    if far < 1e-6 or speed_mps <= 0.0:
        raise ValueError("two places and a speed are wanted")
    t = far / speed_mps
    p0, p1 = start[:2], target[:2]
    v0 = speed_mps * np.array([math.cos(start[2]), math.sin(start[2])])
    v1 = speed_mps * np.array([math.cos(target[2]), math.sin(target[2])])
    square = (3.0 * (p1 - p0) - (2.0 * v0 + v1) * t) / t**2
    cube = (2.0 * (p0 - p1) + (v0 + v1) * t) / t**3
    return Spline(np.stack([p0, v0, square, cube]), t)


def steering_rate(spline: Spline, speed_mps: float, articulation_rad: float, lead_m: float, trail_m: float) -> float:
    """Return the rate of the joint that follows a spline from its start, rad/s: Eq. (9)."""
    turn = speed_mps * float(spline.curvature(np.zeros(1))[0])
    above = (lead_m * math.cos(articulation_rad) + trail_m) * turn - speed_mps * math.sin(articulation_rad)
    return above / trail_m


def drivable(
    spline: Spline, start_bend_rad: float, limits: tuple[float, float, float], lead_m: float, trail_m: float
) -> bool:
    """Return whether the joint can follow a spline: `limits` are its angle (rad), its rate (rad/s), the speed (m/s).

    The joint's angle is carried along the curve by Eq. (1), as the bodies would be.
    """
    most, rate, speed = limits
    t = np.linspace(0.0, spline.t_end, 60)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spline.at(t), axis=0), axis=1))])
    curvature = spline.curvature(t)
    bend = start_bend_rad
    for k in range(len(t) - 1):
        step = way[k + 1] - way[k]
        slope = (curvature[k] * (lead_m * math.cos(bend) + trail_m) - math.sin(bend)) / trail_m
        if abs(slope) * speed > rate:
            return False
        bend += step * slope
        if abs(bend) > most:
            return False
    return True
