"""How the wheels' turn is off, learned while the walls tell the turn: worn or unequal wheels, a joint whose zero is off.

    measured turn = scale · turn + curvature · distance

Compared over stretches, not from scan to scan: wheel poses come late by a part of a scan's time, and a least-squares fit of
late turns to true ones makes the scale too small.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.odometry.wheels.stretch import Compared

_EDGES_RAD = math.radians(1.0)  # at both ends of a stretch the wheels are late or early
_WANDER_PER_SQRT_M = 1e-4  # of both: tyres wear and warm up, 1 % in 10 km
_GATE_SIGMAS = 3.0  # a stretch that is farther off was slip, or a wrong match: one in 400 by chance


class WheelTurn:
    """Puts the wheels' turn right; `learn` with each stretch that was compared with the walls."""

    def __init__(self, scale_std: float, curvature_std: float) -> None:
        """Begin with turns that are right but for these standard deviations (1; rad/m)."""
        self.state = np.array([1.0, 0.0])
        self._P = np.diag([scale_std**2, curvature_std**2])
        self._wander = _WANDER_PER_SQRT_M**2 * np.diag([float(scale_std > 0.0), float(curvature_std > 0.0)])

    def corrected(self, turn_rad: float, forward_m: float) -> tuple[float, float]:
        """Return a measured turn (rad) as it should have been, and the standard deviation of that correction (rad)."""
        turn = (turn_rad - self.state[1] * forward_m) / self.state[0]
        h = np.array([turn, forward_m])
        return float(turn), math.sqrt(float(h @ self._P @ h))

    def learn(self, stretch: Compared) -> None:
        """Update by a stretch (a Kalman filter's step, outliers left out)."""
        h = np.array([stretch.walls_rad, stretch.walls_m])
        error = stretch.wheels_rad - float(h @ self.state)
        S = float(h @ self._P @ h) + stretch.variance + _EDGES_RAD**2
        if error * error < _GATE_SIGMAS**2 * S:
            gain = self._P @ h / S
            self.state = self.state + gain * error
            self._P = self._P - np.outer(gain, h @ self._P)
        self._P = self._P + stretch.length_m * self._wander
