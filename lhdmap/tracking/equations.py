"""Eqs. (8) to (12) of the load-haul-dump paper, corrected and as printed; the errata and their proof: docs/tracking.md."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray

Lengths2 = tuple[float, float]
"""L0, L1: joint to front and to rear axle, m."""


def rates(p: FloatArray, rear_mps: float, rate_rps: float, curvature: Lengths2, lengths: Lengths2) -> FloatArray:
    """Return dp/dt (5,) of p = (z0, z1, θ̃0, θ̃1, β), Eq. (9) corrected; `curvature` (1/m) at both projections.

    Row 2 has sin θ̃1, row 4 of B has -L0 / D, and each row its own curvature (errata).
    """
    z0, z1, t0, t1, b = p.tolist()
    (k0, k1), (front_m, rear_m) = curvature, lengths
    d = front_m + rear_m * math.cos(b)
    v0 = ((rear_m + front_m * math.cos(b)) * rear_mps - front_m * rear_m * math.sin(b) * rate_rps) / d
    turn = (rear_mps * math.sin(b) - front_m * rate_rps) / d
    return np.array(
        [
            v0 * math.sin(t0),
            rear_mps * math.sin(t1),
            turn + rate_rps - k0 * v0 * math.cos(t0) / (1.0 - k0 * z0),
            turn - k1 * rear_mps * math.cos(t1) / (1.0 - k1 * z1),
            rate_rps,
        ]
    )


def printed(p: FloatArray, curvature: float, lengths: Lengths2) -> tuple[FloatArray, FloatArray]:
    """Return A(p) (for v1 = 1) and B(p), both (5,), as Eq. (9) prints them."""
    z0, z1, t0, t1, b = p.tolist()
    front_m, rear_m = lengths
    d, e = front_m + rear_m * math.cos(b), rear_m + front_m * math.cos(b)
    both = front_m * rear_m * math.sin(b)
    bent0 = curvature * math.cos(t0) / (1.0 - curvature * z0)
    bent1 = curvature * math.cos(t1) / (1.0 - curvature * z1)
    drift = [e / d * math.sin(t0), math.sin(t0), math.sin(b) / d - e * bent0 / d, math.sin(b) / d - bent1, 0.0]
    across = [
        -both * math.sin(t0) / d,
        0.0,
        rear_m * math.cos(b) / d + both * bent0 / d,
        front_m * math.cos(b) / d,
        1.0,
    ]
    return np.array(drift), np.array(across)


def equilibrium(curvature: float, lengths: Lengths2) -> FloatArray:
    """Return p (5,) on a circle with z0 + z1 = 0, Eq. (10): exact with θ0 = θ1 + β (Eq. (4) prints the other sign)."""
    front_m, rear_m = lengths
    z0 = 0.25 * curvature * (front_m**2 - rear_m**2)
    bend = math.atan(front_m * curvature / (1.0 - curvature * z0))
    bend += math.atan(rear_m * curvature / (1.0 + curvature * z0))
    return np.array([z0, -z0, 0.0, 0.0, bend])


def reduced(
    rear_mps: float, lag_s: float, lengths: Lengths2, curvature: float = 0.0, bend: float = 0.0, z1: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return A (4, 4) and B (4, 1) of x = (z1, θ̃1, β, ω): what the steering can reach, for a commanded rate.

    z0 and θ̃0 follow from it (Eqs. (5), (6)): of the paper's five states two depend on the others.
    """
    front_m, rear_m = lengths
    d = front_m + rear_m * math.cos(bend)
    a = np.zeros((4, 4))
    a[0, 1] = rear_mps
    a[1, 0] = -rear_mps * curvature**2 / (1.0 - curvature * z1) ** 2
    a[1, 2] = rear_mps * (d * math.cos(bend) + rear_m * math.sin(bend) ** 2) / d**2
    a[1, 3] = -front_m / d
    a[2, 3] = 1.0
    a[3, 3] = -1.0 / lag_s
    b = np.zeros((4, 1))
    b[3, 0] = 1.0 / lag_s
    return a, b


def outputs(lengths: Lengths2) -> FloatArray:
    """Return C (3, 4): z0 + z1, z0 and z1 of x = (z1, θ̃1, β, ω), to first order."""
    front_m, rear_m = lengths
    front = [1.0, front_m + rear_m, front_m, 0.0]
    rear = [1.0, 0.0, 0.0, 0.0]
    return np.array([[a + b for a, b in zip(front, rear, strict=True)], front, rear])
