"""Key landmarks of a tunnel (paper, Section 3.2, step 3), each step that the paper leaves open decided.

For each landmark j, the values of column j of the similarity matrix (each other landmark on j) in rising order:

* threshold: the value of the last landmark before the first that is no local neighbour. The paper calls it a minimum; a low
  fitness is a good one, so it is the largest that a match may have. Landmark j itself, with fitness 0, is left out of the order.
* local neighbours are a fixed window, `neighbours` to each side: the radius that the paper would define them by is the result.
* delta: the next value less the threshold, never negative (the paper has it the other way round).
* where the first in the order is already no neighbour, nothing is selected: threshold, delta and radius are 0, it is no key.
* radius: the largest r for which all landmarks within r have a value up to the threshold. The paper's "distance to the selected
  one" is that of the last accepted; those skipped in between would go unnoticed. A pair that does not match at all counts for
  nobody. So a radius is 1 or 2, and larger only where the two scanners' clouds overlap further (docs/landmarks.md).
* the best of the first and of the last ten are keys, if they have a radius; in a short tunnel the second only where it is apart
  from the first, as all others.
* "radius greater than" and "farther than" are strict, as the paper has them.
* "different from the other keys" needs no test: keys are farther apart than neighbours, and the threshold is below the value of
  each that is no neighbour. Where the spacing is smaller than the neighbourhood, that is tested.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray


class Keys(NamedTuple):
    """Of n landmarks: `threshold`, `delta` (m²), `radius` (landmarks), `key`; all (n,)."""

    threshold: FloatArray
    delta: FloatArray
    radius: npt.NDArray[np.int32]
    key: npt.NDArray[np.bool_]


def choose_keys(F: npt.NDArray[np.floating], settings: LandmarkSettings) -> Keys:
    """Return thresholds, radii and keys from the similarity matrix F (n, n), source i on target j, NaN where not compared."""
    n = len(F)
    judged = [judged_landmark(F[:, j].astype(np.float64), j, settings) for j in range(n)]
    threshold, delta = np.array([one[0] for one in judged]), np.array([one[1] for one in judged])
    radius = np.array([one[2] for one in judged], dtype=np.int32)
    key = np.zeros(n, dtype=np.bool_)
    for first, last in ((0, settings.ends), (n - settings.ends, n)):
        rows = range(max(first, 0), min(last, n))
        for j in sorted(rows, key=lambda j: (-radius[j], -delta[j], j))[:1]:
            key[j] = radius[j] > 0 and _apart(j, key, F, threshold, settings)
    for j in sorted(range(n), key=lambda j: (-radius[j], -delta[j], j)):
        if radius[j] > settings.min_radius and _apart(j, key, F, threshold, settings):
            key[j] = True
    return Keys(threshold, delta, radius, key)


def judged_landmark(column: FloatArray, j: int, settings: LandmarkSettings) -> tuple[float, float, int]:
    """Return threshold, delta (m²) and radius (landmarks) of landmark `j` from its column (n,) of the similarity matrix."""
    away = np.abs(np.arange(len(column)) - j)
    neighbours = (away > 0) & (away <= settings.neighbours)
    others = column[away > settings.neighbours]
    no_match = settings.limit_m**2
    first_other = float(np.nanmin(others)) if np.isfinite(others).any() else no_match
    accepted = neighbours & (column < min(first_other, no_match))
    if not accepted.any():
        return 0.0, 0.0, 0
    threshold = float(column[accepted].max())
    refused = neighbours & ~accepted
    radius = int(away[refused].min()) - 1 if refused.any() else int(away[neighbours].max())
    return threshold, first_other - threshold, radius


def _apart(
    j: int, key: npt.NDArray[np.bool_], F: npt.NDArray[np.floating], threshold: FloatArray, settings: LandmarkSettings
) -> bool:
    """Return whether a landmark is far enough from the keys so far, and neither is taken for the other."""
    keys = np.flatnonzero(key)
    if len(keys) and np.abs(keys - j).min() <= settings.key_spacing:
        return False
    near = keys[np.abs(keys - j) <= settings.neighbours]
    return not ((F[j, near] <= threshold[near]) | (F[near, j] <= threshold[j])).any()
