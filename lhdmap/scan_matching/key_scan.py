"""A scan that is kept of a drive: what smoothing, landmarks and localization look at again."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.geometry import se2
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.scan_matching.step_error import NO_ERROR, StepError, measured_covariance


class KeyScan(NamedTuple):
    """A scan kept: time, pose (3,) by odometry, distance travelled, hits (N, 3), and how far its step may be off.

    The hits are in the level base frame, heights absolute. `error`: what the step from the key before adds to the error of the
    way, in this key's body axes (m, m, rad).
    """

    time_ns: int
    pose: FloatArray
    travelled_m: float
    points: Float32Array
    error: StepError = NO_ERROR

    def covariance(self, before: KeyScan) -> FloatArray:
        """Return the covariance (3, 3) of the step from the key `before` as it was measured, in this key's axes."""
        return measured_covariance(before.error.jitter, se2.between(before.pose, self.pose), self.error)
