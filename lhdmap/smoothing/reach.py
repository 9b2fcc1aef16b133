"""How far an earlier place may be from where the odometry puts it, by the odometry's own covariance."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.steps import step_covariances

_SIGMAS = 2.5
_MOST_M = 30.0  # beyond it the odometry says nothing that would help


class Drift:
    """Answers for pairs of keys from sums along the drive: no cost beyond that of a look-up.

    What the steps' headings do to the place of a later key p is sum(v_k |p - p_k|²) = |p|² sum(v_k) - 2 p sum(v_k p_k) +
    sum(v_k |p_k|²).
    """

    def __init__(self, keys: list[KeyScan], settings: SmoothingSettings) -> None:
        poses = np.array([key.pose for key in keys]).reshape(-1, 3)
        steps = np.array(step_covariances(keys, settings)).reshape(-1, 3, 3)
        middle = poses[:, :2].mean(axis=0) if len(keys) else np.zeros(2)  # so that squares keep their digits
        self._at = poses[:, :2] - middle
        turn, ends = steps[:, 2, 2], self._at[1:]
        parts = (
            steps[:, 0, 0] + steps[:, 1, 1],
            turn,
            turn * ends[:, 0],
            turn * ends[:, 1],
            turn * (ends**2).sum(axis=1),
        )
        pulled = np.array([np.hypot(*key.error.pull[:2]) for key in keys[1:]])
        self._sums = np.array([np.concatenate([[0.0], np.cumsum(part)]) for part in (*parts, pulled)])

    @property
    def most_m(self) -> float:
        """Largest radius that any pair can have, m."""
        return _MOST_M if self._sums.shape[1] > 1 else 0.0

    def radius_m(self, earlier: npt.NDArray[np.int64], current: int) -> FloatArray:
        """Return how far the odometry may have come off between earlier keys (K,) and the current one, m."""
        place, turn, turn_x, turn_y, turn_r2, pulled_m = self._sums[:, current, None] - self._sums[:, earlier]
        x, y = self._at[current]
        variance = place + (x * x + y * y) * turn - 2.0 * (x * turn_x + y * turn_y) + turn_r2
        radius: FloatArray = np.minimum(_SIGMAS * np.sqrt(np.maximum(variance, 0.0)) + 2.0 * pulled_m, _MOST_M)
        return radius
