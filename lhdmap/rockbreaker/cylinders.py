"""Cylinders and joints, Eqs. (1) and (2): what a machine's limits follow from, and its kinematics begins with.

Shapes: θ ends in 4, cylinder lengths ρ in 5, whatever stands before. Metres and radians. The sign of cylinder 0 is that of the
mirror image of cylinder 1 (erratum 2).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from lhdmap.messages import FloatArray


class Jointed(Protocol):
    """What is needed of a machine: one setting of its four joints, shape (4,)."""

    def per_joint(self, name: str) -> FloatArray:
        """Return one setting of the four joints, shape (4,)."""


DELTA = np.array([1.0, 1.0, -1.0, -1.0])  # δ of Eq. (2)
CYLINDER_DELTA = np.array([-1.0, 1.0, 1.0, -1.0, -1.0])  # dβ_j / dθ; erratum 2
CYLINDER_JOINT = np.array([0, 0, 1, 2, 3])


def beta_of_rho(machine: Jointed, rho: FloatArray) -> FloatArray:
    """Return β (…, 4) of cylinder lengths (…, 4), one for each joint (of the swing: cylinder 1), Eq. (1); NaN out of reach."""
    u, v = machine.per_joint("body_pin_m"), machine.per_joint("rod_pin_m")
    cosine = (u**2 + v**2 - rho**2) / (2.0 * u * v)
    return np.arccos(np.where(np.abs(cosine) <= 1.0 + 1e-12, np.clip(cosine, -1.0, 1.0), np.nan))


def theta_of_beta(machine: Jointed, beta: FloatArray) -> FloatArray:
    """Return θ (…, 4) of β (…, 4), Eq. (2)."""
    return DELTA * beta + np.radians(machine.per_joint("offset_deg"))


def cylinder_beta(machine: Jointed, theta: FloatArray) -> FloatArray:
    """Return β of the five cylinders (…, 5) of θ (…, 4): Eq. (2) solved for β, cylinder 0 by the mirror image."""
    offset = np.radians(machine.per_joint("offset_deg"))[CYLINDER_JOINT]
    mirrored = np.where(np.arange(5) == 0, -1.0, 1.0)
    own_delta = DELTA[CYLINDER_JOINT]
    return own_delta * (mirrored * theta[..., CYLINDER_JOINT] - offset)


def rho_of_theta(machine: Jointed, theta: FloatArray) -> FloatArray:
    """Return the cylinder lengths (…, 5) of θ (…, 4), Eq. (1) solved for ρ."""
    return lengths(machine, np.cos(cylinder_beta(machine, theta)))


def lengths(machine: Jointed, cos_beta: FloatArray) -> FloatArray:
    """Return the cylinder lengths (…, 5) of the cosines of their β (…, 5), Eq. (1)."""
    u, v = pins(machine)
    return np.asarray(np.sqrt(u**2 + v**2 - 2.0 * u * v * cos_beta))


def pins(machine: Jointed) -> tuple[FloatArray, FloatArray]:
    """Return how far the pins of the five cylinders are from their joints, on the body and on the rod's side, each (5,)."""
    return machine.per_joint("body_pin_m")[CYLINDER_JOINT], machine.per_joint("rod_pin_m")[CYLINDER_JOINT]


def theta_of_rho(machine: Jointed, rho: FloatArray) -> FloatArray:
    """Return θ (…, 4) of cylinder lengths (…, 5), Eqs. (1) and (2); of the two swing cylinders ρ_1 is used."""
    return theta_of_beta(machine, beta_of_rho(machine, rho[..., 1:]))
