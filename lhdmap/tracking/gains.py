"""Gains by the signed speed: there is no other way to a gain, so one of the wrong sign cannot be had."""

from __future__ import annotations

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import outputs, reduced
from lhdmap.tracking.settings import TrackingSettings

PERIOD_S = 0.05
_FASTEST_MPS, _COUNT = 14.0, 9
_ROLLS_MPS = 0.15


class Gains:
    """LQR gains on x = (z1, θ̃1, β, ω) for both signs of v1, interpolated over the logarithm of its size."""

    def __init__(self, model: DriveModel, settings: TrackingSettings) -> None:
        """Solve the Riccati equation for some speeds of each sign."""
        self._slow = settings.slow_mps
        self._log = np.linspace(np.log(self._slow), np.log(_FASTEST_MPS), _COUNT)
        self._table = {
            sign: np.stack([gain_of(sign * speed, model, settings) for speed in np.exp(self._log)]) for sign in (1, -1)
        }

    def at(self, rear_mps: float, gear: int) -> FloatArray:
        """Return K (4,) for a signed speed of the rear axle; `gear` decides the sign where the machine stands."""
        at = np.log(max(abs(rear_mps), self._slow))
        table = self._table[direction(rear_mps, gear)]
        return np.array([np.interp(at, self._log, table[:, k]) for k in range(4)])


def direction(rear_mps: float, gear: int) -> int:
    """Return which way the machine goes: by its speed, whatever gear is in; by the gear where it stands."""
    if abs(rear_mps) < _ROLLS_MPS:
        return gear
    return 1 if rear_mps > 0.0 else -1


def gain_of(rear_mps: float, model: DriveModel, settings: TrackingSettings) -> FloatArray:
    """Return K (4,) of the LQR at one signed speed (m/s, not 0): ω = -K x, held for 50 ms, makes the settings' cost least."""
    lengths = (model.front_m, model.rear_m)
    a, b = held(*reduced(rear_mps, model.steering_lag_s, lengths), PERIOD_S)
    c = outputs(lengths)
    weights = np.array([settings.sum_weight, settings.axle_weight, settings.axle_weight])
    q = c.T @ (weights[:, None] * c) + np.diag([0.0, settings.heading_weight, settings.joint_weight, 0.0])
    p = riccati(a, b @ b.T / settings.rate_weight, q)
    found: FloatArray = (b.T @ p @ a)[0] / (settings.rate_weight + float((b.T @ p @ b)[0, 0]))
    return found


def held(a: FloatArray, b: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the matrices of a step with a held input: the exponential, as a series."""
    size = len(a)
    whole = np.zeros((size + b.shape[1], size + b.shape[1]))
    whole[:size, :size], whole[:size, size:] = a * step_s, b * step_s
    total, term = np.eye(len(whole)), np.eye(len(whole))
    for k in range(1, 25):
        term = term @ whole / k
        total = total + term
    return total[:size, :size], total[:size, size:]


def riccati(a: FloatArray, g: FloatArray, h: FloatArray) -> FloatArray:
    """Return P = A'P (I + G P)^-1 A + H, by doubling: each round covers twice as many periods as the one before."""
    one = np.eye(len(a))
    for _ in range(40):
        inner = np.linalg.inv(one + g @ h)
        a, g, after = a @ inner @ a, g + a @ inner @ g @ a.T, h + a.T @ h @ inner @ a
        if np.abs(after - h).max() <= 1e-12 * np.abs(after).max():
            break
        h = after
    return after
