"""Kinematics of the centre-articulated machine: Eq. (1) and (2) of the autonomous-loading paper.

θ is the heading of the FRONT body, v the speed of the front axle along it, γ = θ_front − θ_rear (positive when the
machine bends to the left), ω = dγ/dt. Neither axle slips sideways. The errata confirm the equations as printed.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.geometry import articulated
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray


def heading_rate(speed_mps: float, articulation_rad: float, articulation_rate_rps: float, machine: Machine) -> float:
    """Return dθ/dt of the front body, rad/s: Eq. (1), third row.

    Turning the joint alone turns the front body too, so the rate of the articulation is not to be left out.
    """
    front_m, rear_m = machine.dimensions.joint_to_front_axle_m, machine.dimensions.joint_to_rear_axle_m
    turn = speed_mps * math.sin(articulation_rad) + rear_m * articulation_rate_rps
    return turn / (front_m * math.cos(articulation_rad) + rear_m)


def articulation_for_curvature(curvature_pm: float, machine: Machine) -> float:
    """Return the steady γ (rad) on an arc of signed curvature (1/m): κ (L_f cos γ + L_r) = sin γ, in closed form.

    Raises:
        ValueError: no articulation drives so tight an arc.
    """
    front_m, rear_m = machine.dimensions.joint_to_front_axle_m, machine.dimensions.joint_to_rear_axle_m
    amplitude = math.hypot(1.0, curvature_pm * front_m)
    if abs(curvature_pm * rear_m) > amplitude:
        raise ValueError(f"an arc of radius {1 / curvature_pm:.2f} m is tighter than the machine can bend")
    return math.asin(curvature_pm * rear_m / amplitude) + math.atan(curvature_pm * front_m)


def T_base_rear(articulation_rad: float, machine: Machine) -> FloatArray:  # noqa: N802  # frames in the name
    """Return the pose of `rear_link` in `base_link`, shape (4, 4)."""
    size = machine.dimensions
    return articulated.T_base_rear(articulation_rad, size.joint_to_front_axle_m, size.joint_to_rear_axle_m)


@nb.njit(cache=True)
def articulation_along_path(curvature_pm: FloatArray, step_m: float, front_m: float, rear_m: float) -> FloatArray:
    """Return γ (rad), shape (N,), for a front axle that follows a path of the given curvature, sampled each `step_m`.

    Eq. (1) with dθ/ds = κ gives dγ/ds = (κ (L_f cos γ + L_r) − sin γ) / L_r, free of time: it holds for any speed, and
    in reverse the joint goes back through the same angles. Heun's rule, from the steady angle of the start.
    """
    angle = np.empty(len(curvature_pm))
    angle[0] = math.atan(curvature_pm[0] * front_m) + math.asin(
        curvature_pm[0] * rear_m / math.hypot(1.0, curvature_pm[0] * front_m)
    )
    for i in range(len(curvature_pm) - 1):
        slope = (curvature_pm[i] * (front_m * math.cos(angle[i]) + rear_m) - math.sin(angle[i])) / rear_m
        guess = angle[i] + step_m * slope
        slope_end = (curvature_pm[i + 1] * (front_m * math.cos(guess) + rear_m) - math.sin(guess)) / rear_m
        angle[i + 1] = angle[i] + 0.5 * step_m * (slope + slope_end)
    return angle
