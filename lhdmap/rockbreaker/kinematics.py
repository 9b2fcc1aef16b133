"""Direct and inverse kinematics and Jacobians, over any number of configurations at once.

Shapes: θ and poses x = [x, y, z, φ] end in 4, cylinder lengths ρ in 5, whatever stands before. Metres and radians. The sign of
cylinder 0 is that of the mirror image of cylinder 1 (erratum 2), φ = θ2 + θ3 + θ4 − γ (erratum 5).
"""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.cylinders import CYLINDER_DELTA, CYLINDER_JOINT, cylinder_beta, lengths, pins
from lhdmap.rockbreaker.machine import Rockbreaker


def pose_of_theta(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return poses [x, y, z, φ] (…, 4) of θ (…, 4), Eq. (3); φ in [0, 2π)."""
    _, a2, a3, a4 = machine.links_m
    t2, t23, t234 = np.moveaxis(np.cumsum(theta[..., 1:], axis=-1), -1, 0)
    reach = machine.links_m[0] + a2 * np.cos(t2) + a3 * np.cos(t23) + a4 * np.cos(t234)
    z = machine.base.height_m + a2 * np.sin(t2) + a3 * np.sin(t23) + a4 * np.sin(t234)
    phi = np.mod(t234 - np.radians(machine.base.breaker_offset_deg), 2.0 * np.pi)
    return np.stack([np.cos(theta[..., 0]) * reach, np.sin(theta[..., 0]) * reach, z, phi], axis=-1)


def theta_of_pose(machine: Rockbreaker, pose: FloatArray) -> FloatArray:
    """Return θ (…, 4) of poses [x, y, z, φ] (…, 4), the elbow as the cylinders allow; NaN out of reach. Limits: `within`."""
    swing = np.arctan2(pose[..., 1], pose[..., 0])
    planar = np.stack([np.hypot(pose[..., 0], pose[..., 1]), pose[..., 2], pose[..., 3]], axis=-1)
    return np.concatenate([swing[..., None], planar_theta(machine, planar)], axis=-1)


def planar_theta(machine: Rockbreaker, planar: FloatArray) -> FloatArray:
    """Return θ_2, θ_3, θ_4 (…, 3) of radius, height and φ (…, 3): the planar 3R arm; NaN where it is out of reach.

    θ_4 is given in the turn that is nearest to the middle of its limits.
    """
    a1, a2, a3, a4 = machine.links_m
    whole = planar[..., 2] + np.radians(machine.base.breaker_offset_deg)
    along = planar[..., 0] - a1 - a4 * np.cos(whole)
    up = planar[..., 1] - machine.base.height_m - a4 * np.sin(whole)
    cosine = (along**2 + up**2 - a2**2 - a3**2) / (2.0 * a2 * a3)
    t3 = machine.elbow * np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
    t2 = np.arctan2(up, along) - np.arctan2(a3 * np.sin(t3), a2 + a3 * np.cos(t3))
    middle = machine.theta_limits.mean(axis=0)
    t2 = turned(t2, middle[1])
    return np.stack([t2, t3, turned(whole - t2 - t3, middle[3])], axis=-1)


def turned(angle: FloatArray, middle: float | FloatArray) -> FloatArray:
    """Return the angles in the turn around `middle`."""
    return np.asarray(angle - 2.0 * np.pi * np.round((angle - middle) / (2.0 * np.pi)))


def within(machine: Rockbreaker, theta: FloatArray, tolerance: float = 1e-9) -> np.ndarray:
    """Return for θ (…, 4) whether each joint and so each cylinder is within its limits (NaN: not), shape (…), bool."""
    low, high = machine.theta_limits
    return np.asarray(np.all((theta >= low - tolerance) & (theta <= high + tolerance), axis=-1))


def jacobian_theta(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return J_θ = dx/dθ (…, 4, 4), Eq. (4)."""
    _, a2, a3, a4 = machine.links_m
    angles = np.moveaxis(np.cumsum(theta[..., 1:], axis=-1), -1, 0)
    lengths = (a2, a3, a4)
    sines = [length * np.sin(angle) for length, angle in zip(lengths, angles, strict=True)]
    cosines = [length * np.cos(angle) for length, angle in zip(lengths, angles, strict=True)]
    s1, c1 = np.sin(theta[..., 0]), np.cos(theta[..., 0])
    alpha = machine.links_m[0] + sum(cosines)
    jacobian = np.zeros((*theta.shape[:-1], 4, 4))
    jacobian[..., 0, 0], jacobian[..., 1, 0] = -s1 * alpha, c1 * alpha
    for k in range(3):
        jacobian[..., 0, k + 1] = -c1 * sum(sines[k:])
        jacobian[..., 1, k + 1] = -s1 * sum(sines[k:])
        jacobian[..., 2, k + 1] = sum(cosines[k:])
        jacobian[..., 3, k + 1] = 1.0
    return jacobian


def rho_rate(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return dρ_j / dθ of each cylinder for its own joint (…, 5): δ_j u v sin β / ρ (Eq. (5), errata 3 and 4), m/rad."""
    beta = cylinder_beta(machine, theta)
    u, v = pins(machine)
    return np.asarray(CYLINDER_DELTA * u * v * np.sin(beta) / lengths(machine, np.cos(beta)))


def jacobian_rho(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return dρ/dθ (…, 5, 4): J_ρ⁻¹ J_β* of the paper, with erratum 4."""
    jacobian = np.zeros((*theta.shape[:-1], 5, 4))
    rates = rho_rate(machine, theta)
    for cylinder, joint in enumerate(CYLINDER_JOINT):
        jacobian[..., cylinder, joint] = rates[..., cylinder]
    return jacobian


def jacobian_pose(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return dρ/dx (…, 5, 4): J_ρ⁻¹ J_β* J_θ⁻¹."""
    return np.asarray(jacobian_rho(machine, theta) @ np.linalg.inv(jacobian_theta(machine, theta)))


def planar_rates(machine: Rockbreaker, theta: FloatArray, planar_rate: FloatArray) -> FloatArray:
    """Return the rates of θ_2, θ_3, θ_4 (…, 3) for rates of radius, height and φ (…, 3); closed form of J_θ⁻¹."""
    _, a2, a3, a4 = machine.links_m
    t2, t23, t234 = np.moveaxis(np.cumsum(theta[..., 1:], axis=-1), -1, 0)
    turn = planar_rate[..., 2]
    along = planar_rate[..., 0] + a4 * turn * np.sin(t234)
    up = planar_rate[..., 1] - a4 * turn * np.cos(t234)
    sine = np.sin(theta[..., 2])
    rate2 = (along * np.cos(t23) + up * np.sin(t23)) / (a2 * sine)
    rate23 = -(along * np.cos(t2) + up * np.sin(t2)) / (a3 * sine)
    return np.stack([rate2, rate23 - rate2, turn - rate23], axis=-1)
