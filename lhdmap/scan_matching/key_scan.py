"""A scan that is kept of a drive: what smoothing, landmarks and localization look at again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import Float32Array, FloatArray

NO_STEP = np.zeros((3, 3))
"""Covariance of the step before the first key scan, which has none."""


class KeyScan(NamedTuple):
    """A scan kept: time, pose (3,) by odometry, distance travelled, hits (N, 3), whether the odometry was weak, and its step.

    The hits are in the level base frame, heights absolute. `weak` tells of the way since the key before; `step_covariance` (3, 3)
    is that of the pose seen from the key before, in this key's body axes (m, m, rad).
    """

    time_ns: int
    pose: FloatArray
    travelled_m: float
    points: Float32Array
    weak: bool
    step_covariance: FloatArray
