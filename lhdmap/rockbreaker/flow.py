"""What the hydraulics allow along a path: flow is linear in σ̇, so the limits are one curve σ̇ ≤ F(σ).

A cylinder that extends is fed on its blind side, one that retracts on its rod side (Eq. (7)); as σ̇ ≥ 0, the direction is a
property of the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.cylinders import CYLINDER_JOINT
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.paths import Path, cylinders

LIMITS = ("Q1", "Q2", "Q3", "Q4", "pump")
_MIX = np.eye(4)[CYLINDER_JOINT]  # (5, 4): which valve feeds which cylinder


def flows_m3ps(machine: Rockbreaker, rho_rates: FloatArray) -> FloatArray:
    """Return Q_1 … Q_4 and Q_p (…, 5) for cylinder rates (…, 5) in m/s (or volumes for strokes), Eq. (7)."""
    blind = machine.per_joint("blind_area_m2")[CYLINDER_JOINT]
    rod = machine.per_joint("rod_area_m2")[CYLINDER_JOINT]
    valves = (np.where(rho_rates > 0.0, blind, rod) * np.abs(rho_rates)) @ _MIX
    return np.concatenate([valves, valves.sum(axis=-1, keepdims=True)], axis=-1)


@dataclass(frozen=True, slots=True)
class FlowCurve:
    """Over a grid of σ (N,): the load of each limit at σ̇ = 1 (N, 5), and the highest σ̇ that all limits allow (N,), 1/s."""

    sigma: FloatArray
    loads: FloatArray
    highest: FloatArray


def flow_curve(path: Path, sigma: FloatArray) -> FlowCurve:
    """Return the limits along `path` at σ (N,): valves, pump, cylinder speeds, and for DSJM the swing rate C5 (erratum 8)."""
    machine = path.machine
    theta, theta_rate = path.motion(sigma)
    _, rho_rates = cylinders(machine, theta, theta_rate)
    loads = flows_m3ps(machine, rho_rates) / machine.flow_limits_m3ps
    worst = loads.max(axis=1)
    if path.kind == "dsjm":
        worst = np.maximum(worst, np.abs(theta_rate[:, 0]) / machine.swing_rate_limit)
    worst = np.maximum(worst, speed_loads(machine, rho_rates).max(axis=1))
    return FlowCurve(sigma, loads, 1.0 / np.maximum(worst, 1e-9))


def speed_loads(machine: Rockbreaker, rho_rates: FloatArray) -> FloatArray:
    """Return cylinder speeds over their limits (…, 5); 0 where the machine states none."""
    limits = machine.per_joint("max_speed_mps")[CYLINDER_JOINT]
    return np.where(limits > 0.0, np.abs(rho_rates) / np.where(limits > 0.0, limits, 1.0), 0.0)


def least_duration_s(machine: Rockbreaker, rho_from: FloatArray, rho_to: FloatArray) -> float:
    """Return a bound from below for any path and timing between two cylinder configurations (5,).

    What a valve must let through is at least the net stroke times the area that is fed; likewise the pump.
    """
    return float(np.max(flows_m3ps(machine, rho_to - rho_from) / machine.flow_limits_m3ps))
