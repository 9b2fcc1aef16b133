"""Gains by the signed speed: there is no other way to a gain, so one of the wrong sign cannot be had."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_continuous_are

from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import outputs, reduced
from lhdmap.tracking.settings import TrackingSettings

_FASTEST_MPS, _COUNT = 14.0, 12


class Gains:
    """LQR gains on x = (z1, θ̃1, β, ω) for both signs of v1, interpolated over the logarithm of its size."""

    def __init__(self, model: DriveModel, settings: TrackingSettings) -> None:
        """Solve the Riccati equation for a dozen speeds of each sign."""
        self._slow = settings.slow_mps
        self._log = np.linspace(np.log(self._slow), np.log(_FASTEST_MPS), _COUNT)
        self._table = {
            sign: np.stack([gain_of(sign * speed, model, settings) for speed in np.exp(self._log)]) for sign in (1, -1)
        }

    def at(self, rear_mps: float, gear: int) -> FloatArray:
        """Return K (4,) for a signed speed of the rear axle; `gear` decides the sign where the machine stands."""
        sign = gear if abs(rear_mps) < 0.5 * self._slow else (1 if rear_mps > 0.0 else -1)
        at = np.log(max(abs(rear_mps), self._slow))
        table = self._table[sign]
        return np.array([np.interp(at, self._log, table[:, k]) for k in range(4)])


def gain_of(rear_mps: float, model: DriveModel, settings: TrackingSettings) -> FloatArray:
    """Return K (4,) of the LQR at one signed speed (m/s, not 0): ω = -K x makes the cost of the settings least."""
    lengths = (model.front_m, model.rear_m)
    a, b = reduced(rear_mps, model.steering_lag_s, lengths)
    c = outputs(lengths)
    weights = np.array([settings.sum_weight, settings.axle_weight, settings.axle_weight])
    q = c.T @ (weights[:, None] * c) + np.diag([0.0, settings.heading_weight, settings.joint_weight, 0.0])
    r = np.array([[settings.rate_weight]])
    found: FloatArray = np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))[0]
    return found
