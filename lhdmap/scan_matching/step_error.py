"""How far a step of the planar odometry may be off, in parts that add up in different ways.

Three parts, each in the body's axes (m, m, rad):

- **walk**: the map is renewed at poses that are a little off, so what a scan is off by stays for good, in part. It adds up like a
  random walk, the faster the more of what the scan tells is noise of the walls' directions, and the shorter its lever is.
- **pull**: such noise also pulls all scans the same way. It adds up with the way itself.
- **jitter**: what a scan is off the local map. It does not add up: it counts at both ends of a step, however long that is.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray


class StepError(NamedTuple):
    """Error of a step in the axes of its end: `walk` (3, 3), `pull` (3,) and, of its end alone, `jitter` (3, 3)."""

    walk: FloatArray
    pull: FloatArray
    jitter: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """What the step adds to the error of the way, shape (3, 3): without jitter."""
        return self.walk + np.outer(self.pull, self.pull)

    @property
    def deviations(self) -> FloatArray:
        """What of it stands on the diagonal, as standard deviations, shape (3,): asked for at each scan."""
        return np.sqrt(self.walk.diagonal() + self.pull * self.pull)

    def steadied(self, share: float, pull_rad: float) -> StepError:
        """Return the error where a gyroscope leaves a share of the heading's variance, and pulls it by its own bias."""
        keep = np.array([1.0, 1.0, np.sqrt(share)])
        return StepError(self.walk * np.outer(keep, keep), self.pull + np.array([0.0, 0.0, pull_rad]), self.jitter)

    def then(self, step: FloatArray, after: StepError) -> StepError:
        """Return the error of this step and the next one, `step` (3,), together."""
        return StepError(*_added(self.walk, self.pull, step, after.walk, after.pull), after.jitter)


@nb.njit(cache=True)
def _added(
    walk: FloatArray, pull: FloatArray, step: FloatArray, next_walk: FloatArray, next_pull: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return walk and pull of a step, carried on by the next one, `step` (3,), and with its own added."""
    carried = se2.adjoint(se2.inverse(step))
    return carried @ walk @ carried.T + next_walk, carried @ pull + next_pull


NO_ERROR = StepError(np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)))


def measured_covariance(before: FloatArray, way: FloatArray, error: StepError) -> FloatArray:
    """Return the covariance (3, 3) of a measured `way` (3,), in the axes of its end: the jitter `before` it (3, 3) counts too."""
    return se2.composed_covariance(before, way, error.covariance + error.jitter)
