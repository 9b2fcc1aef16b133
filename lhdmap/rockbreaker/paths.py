"""The two paths of the paper over σ in [0, 1]: decoupled swing (DSJM, Section 3.2) and straight line (CSLM, Section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.cylinders import rho_of_theta
from lhdmap.rockbreaker.kinematics import planar_rates, planar_theta, rho_rate
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.turning import Turning

Kind = Literal["dsjm", "cslm"]
KINDS: tuple[Kind, ...] = ("dsjm", "cslm")
_Planar = tuple[tuple[FloatArray, FloatArray], FloatArray, FloatArray]


@dataclass(frozen=True, slots=True)
class Path:
    """A path between two tips (3,), metres, with the turning of the breaker along it."""

    machine: Rockbreaker
    kind: Kind
    start_m: FloatArray
    end_m: FloatArray
    turning: Turning

    def turned(self, changed: Turning) -> Path:
        """Return the same path of the tip with another turning of the breaker."""
        return replace(self, turning=changed)

    def tip(self, sigma: FloatArray) -> FloatArray:
        """Return the tip (N, 3) at σ (N,)."""
        swing, planar, _ = self._planar(sigma)
        return np.column_stack([planar[:, 0] * np.cos(swing[0]), planar[:, 0] * np.sin(swing[0]), planar[:, 1]])

    def planar(self, sigma: FloatArray) -> FloatArray:
        """Return radius and height of the tip (N, 2) at σ (N,)."""
        return self._planar(sigma)[1]

    def theta(self, sigma: FloatArray) -> FloatArray:
        """Return θ (N, 4) at σ (N,); NaN where the tip is out of reach."""
        return self.motion(sigma)[0]

    def motion(self, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return θ and dθ/dσ (N, 4) at σ (N,)."""
        (swing, swing_rate), planar, planar_rate = self._planar(sigma)
        phi, phi_rate = self.turning(sigma)
        arm = planar_theta(self.machine, np.column_stack([planar, phi]))
        rates = planar_rates(self.machine, np.column_stack([swing, arm]), np.column_stack([planar_rate, phi_rate]))
        return np.column_stack([swing, arm]), np.column_stack([swing_rate, rates])

    def _planar(self, sigma: FloatArray) -> _Planar:
        """Return (swing, its rate) (N,), radius and height (N, 2), and their rates over σ (N, 2)."""
        if self.kind == "dsjm":
            return _decoupled(self.start_m, self.end_m, sigma)
        return _straight_line(self.start_m, self.end_m, sigma)


def _decoupled(start: FloatArray, end: FloatArray, sigma: FloatArray) -> _Planar:
    """Eqs. (9) and (10): swing, radius and height each change in proportion to σ."""
    first = np.array([np.arctan2(start[1], start[0]), np.hypot(start[0], start[1]), start[2]])
    change = np.array([np.arctan2(end[1], end[0]), np.hypot(end[0], end[1]), end[2]]) - first
    all_three = first + sigma[:, None] * change
    rates = np.broadcast_to(change, all_three.shape)
    return (all_three[:, 0], rates[:, 0]), all_three[:, 1:], rates[:, 1:]


def _straight_line(start: FloatArray, end: FloatArray, sigma: FloatArray) -> _Planar:
    """Eq. (12): the tip moves in proportion to σ."""
    change = end - start
    x, y, z = (start + sigma[:, None] * change).T
    radius = np.hypot(x, y)
    divisor = np.maximum(radius, 1e-12)  # a line through the swing axis is refused: the swing would have to jump
    swing_rate = (x * change[1] - y * change[0]) / divisor**2
    radius_rate = (x * change[0] + y * change[1]) / divisor
    planar = np.column_stack([radius, z])
    return (np.arctan2(y, x), swing_rate), planar, np.column_stack([radius_rate, np.full_like(z, change[2])])


def cylinders(machine: Rockbreaker, theta: FloatArray, theta_rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cylinder lengths and their rates (N, 5) of θ and its rates (N, 4)."""
    rates = rho_rate(machine, theta) * theta_rate[:, [0, 0, 1, 2, 3]]
    return rho_of_theta(machine, theta), rates
