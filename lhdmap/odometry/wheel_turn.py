"""How the wheels' turn is off, learned while the walls tell the turn: worn or unequal wheels, a joint whose zero is off.

    measured turn = scale · turn + curvature · way

Compared over stretches, not from scan to scan: wheel poses come late by a part of a scan's time, and a least-squares fit of
late turns to true ones makes the scale too small.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray

_STRETCH_M, _STRETCH_RAD = 1.0, 0.6
_EDGES_RAD = math.radians(1.0)  # at both ends of a stretch the wheels are late or early
_WANDER_PER_SQRT_M = 1e-4
_GATE_SIGMAS = 3.0


class WheelTurn:
    """Puts the wheels' turn right; `measured` with each step of the wheels, `matched` with each pose that the walls gave."""

    def __init__(self, scale_std: float, curvature_std: float) -> None:
        """Begin with turns that are right but for these standard deviations (1; rad/m)."""
        self.state = np.array([1.0, 0.0])
        self._P = np.diag([scale_std**2, curvature_std**2])
        self._wander = _WANDER_PER_SQRT_M**2 * np.diag([float(scale_std > 0.0), float(curvature_std > 0.0)])
        self._last: FloatArray | None = None
        self._restart()

    def corrected(self, turn_rad: float, forward_m: float) -> tuple[float, float]:
        """Return a measured turn (rad) as it should have been, and the standard deviation of that correction (rad)."""
        turn = (turn_rad - self.state[1] * forward_m) / self.state[0]
        h = np.array([turn, forward_m])
        return float(turn), math.sqrt(float(h @ self._P @ h))

    def measured(self, turn_rad: float, sigma_rad: float) -> None:
        """Take a step of the wheels, as measured."""
        self._turn_rad += turn_rad
        self._variance += sigma_rad**2

    def missed(self) -> None:
        """Begin a new stretch at the next match: wheels were silent or slipped, or the walls did not tell the pose."""
        self._last = None

    def matched(self, pose: FloatArray) -> None:
        """Take the pose (3,) that the walls gave at the end of the step measured last; learn once a stretch."""
        if self._last is None:
            self._restart()
        else:
            step = se2.between(self._last, pose)
            self._along += np.array([step[2], step[0]])
            self._length_m += abs(float(step[0]))
        self._last = pose
        if self._length_m > _STRETCH_M or abs(float(self._along[0])) > _STRETCH_RAD:
            self._learn()
            self._restart()

    def _restart(self) -> None:
        self._turn_rad = self._variance = self._length_m = 0.0
        self._along = np.zeros(2)

    def _learn(self) -> None:
        """Update by the stretch that ends here (a Kalman filter's step, outliers left out)."""
        h = self._along
        error = self._turn_rad - float(h @ self.state)
        S = float(h @ self._P @ h) + self._variance + _EDGES_RAD**2
        if error * error < _GATE_SIGMAS**2 * S:
            gain = self._P @ h / S
            self.state = self.state + gain * error
            self._P = self._P - np.outer(gain, h @ self._P)
        self._P = self._P + self._length_m * self._wander
