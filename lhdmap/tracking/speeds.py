"""How fast along a curve: what is asked for, bends, the joint's rate, and the stop at its end."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray
from lhdmap.tracking.path import STEP_M
from lhdmap.tracking.reference import Curve
from lhdmap.tracking.settings import TrackingSettings

_CREEP_MPS = 0.3


class Speeds(NamedTuple):
    """Highest speed (N,) at each row of a curve, m/s, not negative: slowing down before lower ones is in it."""

    caps_mps: FloatArray
    brake_mps2: float


def speeds_of(curve: Curve, asked_mps: FloatArray, model: DriveModel, settings: TrackingSettings) -> Speeds:
    """Return the speeds along a curve; `asked_mps` (N,) at its rows."""
    rows = curve.rows
    rate = settings.rate_share * model.max_rate_rps
    with np.errstate(divide="ignore"):
        bend = np.sqrt(settings.lateral_mps2 / np.maximum(np.abs(rows[:, 3]), 1e-6))
        joint = np.maximum(rate / np.maximum(np.abs(rows[:, 5]), 1e-6), _CREEP_MPS)
    caps = np.minimum(np.minimum(np.abs(asked_mps), model.top_speed_mps), np.minimum(bend, joint))
    order = range(len(caps) - 2, -1, -1) if curve.gear > 0 else range(1, len(caps))
    _held_back(caps, order, curve.gear, settings)
    return Speeds(caps, settings.brake_mps2)


def most_change(
    asked_mps: FloatArray, curvature: FloatArray, model: DriveModel, settings: TrackingSettings
) -> FloatArray:
    """Return the largest |dβ/ds| (N,), rad/m, that the joint's rate allows at the speed that is asked for and bends allow."""
    bend = np.sqrt(settings.lateral_mps2 / np.maximum(np.abs(curvature), 1e-6))
    speed = np.maximum(np.minimum(np.minimum(np.abs(asked_mps), bend), model.top_speed_mps), 0.5)
    for order, by in ((range(1, len(speed)), -1), (range(len(speed) - 2, -1, -1), 1)):
        _held_back(speed, order, by, settings)
    found: FloatArray = settings.rate_share * model.max_rate_rps / speed
    return found


def _held_back(caps: FloatArray, order: range, by: int, settings: TrackingSettings) -> None:
    """Lower speeds to what can be slowed down from, on the side to which `by` leads."""
    for k in order:
        caps[k] = min(caps[k], math.sqrt(caps[k + by] ** 2 + 2.0 * settings.brake_mps2 * STEP_M))
