"""The face that closes the drift: found by RANSAC, fitted robustly, with the odometry's drift as an unknown of its own.

Where x points along the drift's end, y to the left and z up, a face is x = a + b y + c z. A tilted scanner climbs it while it
drives: height and place of seeing are nearly one, so an error of scale e (m/m) looks like a slope. The fit has e as an unknown
with a prior: where the floor makes the machine pitch, it is observed; where it does not, the deviation grows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

CELL_M = 0.1
BLOCK_M = 0.3  # rocks are as large: residuals of cells nearer than this are alike
_TRIES = 250
_NEAR_M = 0.2
_STEEPEST, _FLATTEST = -1.2, 6.0  # dx/dz: an overhang of 50 deg, a slope of 10 deg
_MOST_ASKEW = 0.9
_TUKEY = 4.7
_MOST_POINTS = 1500


class Registration(NamedTuple):
    """How far poses may be wrong along the approach: scale (m/m) and pitch, mounting tilt included (rad); standard deviations."""

    scale: float
    pitch_rad: float


class Face(NamedTuple):
    """x = a + b y + c z in the end frame; `covariance` (4, 4) of a, b, c and the drift; `spread_m` of the residuals."""

    a: float
    b: float
    c: float
    drift: float
    covariance: FloatArray
    spread_m: float
    blocks: int

    def x_at(self, y: FloatArray, z: FloatArray) -> FloatArray:
        """Return x of the face at y and z."""
        return self.a + self.b * y + self.c * z

    @property
    def inclination_deg(self) -> float:
        """Inclination with the sign of Table 6: -90 is a wall."""
        return -math.degrees(math.atan2(1.0, self.c))

    @property
    def inclination_std_deg(self) -> float:
        """Its standard deviation from the fit."""
        return math.degrees(math.sqrt(max(self.covariance[2, 2], 0.0)) / (1.0 + self.c * self.c))


def find(points: FloatArray, rng: np.random.Generator, known: FloatArray | None = None) -> FloatArray | None:
    """Return a, b, c of the face that most (y, z) cells of points (N, 3+) lie on, or None where there is none.

    `known` (3,): the face of the estimate before, tried as well.
    """
    cells, first = np.unique(_cells(points, CELL_M), return_index=True)
    thin = points[first]
    if len(cells) < 12:
        return None
    picks = rng.integers(0, len(thin), (_TRIES, 3))
    corners = thin[picks]
    A = np.concatenate([np.ones((_TRIES, 3, 1)), corners[:, :, 1:3]], axis=2)
    solvable = np.abs(np.linalg.det(A)) > 1e-3
    models = np.linalg.solve(A[solvable], corners[solvable, :, :1])[:, :, 0]
    likely = (models[:, 2] > _STEEPEST) & (models[:, 2] < _FLATTEST) & (np.abs(models[:, 1]) < _MOST_ASKEW)
    models = models[likely]
    if known is not None:
        models = np.concatenate([models, known[None]])
    if not len(models):
        return None
    off = thin[:, 0] - (models[:, :1] + models[:, 1:2] * thin[:, 1] + models[:, 2:3] * thin[:, 2])
    near_m = _NEAR_M * np.maximum(1.0, np.abs(models[:, 2:3]))
    # a flat model needs room along x for its rocks; it must not win by that
    score = (np.clip(1.0 - np.abs(off) / near_m, 0.0, None)).sum(axis=1) / np.sqrt(near_m[:, 0] / _NEAR_M)
    return models[int(score.argmax())]


def fit(points: FloatArray, start: FloatArray, registration: Registration) -> Face:
    """Refine a face by Tukey-weighted regression with one weight for each (y, z) cell; points rows x, y, z, travelled."""
    points = points[:: 1 + len(points) // _MOST_POINTS]
    weights = _cell_weights(points)
    s = points[:, 3] - points[:, 3].mean()
    J = np.column_stack([np.ones(len(points)), points[:, 1], points[:, 2], s])
    model = np.array([*start, 0.0])
    spread = 0.3
    for _ in range(12):
        prior = np.diag([0.0, 1.0 / 0.7**2, 1e-6, 1.0 / _drift_variance(registration, model[2])])
        off = points[:, 0] - J @ model
        flat = max(1.0, abs(float(model[2])))
        spread = max(1.4826 * _weighted_median(np.abs(off), weights), 0.02 * flat)
        u = off / (_TUKEY * spread)
        w = weights * np.where(np.abs(u) < 1.0, (1.0 - u * u) ** 2, 0.0)
        blocks = max(len(np.unique(_cells(points[w > 0.0], BLOCK_M))), 1)
        w *= blocks / max(w.sum(), 1e-9) / spread**2
        H = J.T @ (w[:, None] * J) + prior
        change = np.linalg.solve(H, J.T @ (w * off) - prior @ np.array([0.0, model[1], 0.0, model[3]]))
        model = model + change
        if np.abs(change[:3]).max() < 1e-4:
            break
    a, b, c, drift = (float(value) for value in model)
    return Face(a, b, c, drift, np.linalg.inv(H), spread, blocks)


def _drift_variance(registration: Registration, slope: float) -> float:
    """Scale and pitch move the hits of a face alike: x by e s and, a pitch error d, by c d times the distance."""
    return registration.scale**2 + (slope * registration.pitch_rad) ** 2 + 1e-10


def _cells(points: FloatArray, cell_m: float) -> npt.NDArray[np.int64]:
    """Return a number for the (y, z) cell of each point."""
    cells = np.floor(points[:, 1:3] / cell_m).astype(np.int64)
    return cells[:, 0] * 100_003 + cells[:, 1]


def _cell_weights(points: FloatArray) -> FloatArray:
    """Return weights (N,) that add up to 1 in each cell: near hits are many and must not outvote."""
    _, inverse, counts = np.unique(_cells(points, CELL_M), return_inverse=True, return_counts=True)
    return 1.0 / counts[inverse]


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[int(np.searchsorted(total, 0.5 * total[-1]))]])
