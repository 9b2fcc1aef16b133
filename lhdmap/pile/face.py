"""The face that closes the drift: found by RANSAC, fitted robustly, with the odometry's drift as an unknown of its own.

Where x points along the drift's end, y to the left and z up, a face is x = a + b y + c z. A tilted scanner climbs it while it
drives: height and place of seeing are nearly one, so an error of scale e (m/m) looks like a slope. The fit has e as an unknown
with a prior: where the floor makes the machine pitch, it is observed; where it does not, the deviation grows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.order import cell_numbers, weighted_median

CELL_M = 0.1
BLOCK_M = 0.3  # rocks are as large: residuals of cells nearer than this are alike
_TRIES = 250
_NEAR_M = 0.2
STEEPEST, _FLATTEST = -0.84, 6.0  # dx/dz: an overhang of 40 deg, a slope of 10 deg; floor that falls away leans more
_MOST_ASKEW = 0.9
_TUKEY = 4.7
_MOST_POINTS = 1500


class FaceRegistration(NamedTuple):
    """How far poses may be wrong along the approach: scale (m/m) and pitch, mounting tilt included (rad); standard deviations."""

    scale: float
    pitch_rad: float


class PileFace(NamedTuple):
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
    def rough_m(self) -> float:
        """Spread of the residuals along the normal."""
        return self.spread_m / math.sqrt(1.0 + self.c * self.c)

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
    x, y, z = _first_of_cells(points, CELL_M)
    if len(x) < 12:
        return None
    picks = rng.integers(0, len(x), (_TRIES, 3))
    tried = np.full((1, 3), math.nan) if known is None else known[None]
    model: FloatArray = _most_on(x, y, z, picks, tried)
    return model if math.isfinite(model[0]) else None


def fit(points: FloatArray, start: FloatArray, registration: FaceRegistration) -> PileFace:
    """Refine a face by Tukey-weighted regression with one weight for each (y, z) cell; points rows x, y, z, travelled."""
    thin = np.ascontiguousarray(points[:: 1 + len(points) // _MOST_POINTS])
    model, H, spread, blocks = _regression(thin, start, registration.scale**2, registration.pitch_rad**2)
    a, b, c, drift = (float(value) for value in model)
    return PileFace(a, b, c, drift, np.linalg.inv(H), spread, blocks)


@nb.njit(cache=True, nogil=True)
def _first_of_cells(points, cell_m):  # type: ignore[no-untyped-def]
    """Return x, y, z of the first point in each (y, z) cell, by cell."""
    x, y, z, _ = _columns(points)
    numbers, count = cell_numbers(y, z, cell_m)
    first = np.zeros(count, np.int64)
    for i in range(numbers.size - 1, -1, -1):
        first[numbers[i]] = i + 1
    used = 0
    x_out, y_out, z_out = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        if first[k]:
            i = first[k] - 1
            x_out[used], y_out[used], z_out[used] = x[i], y[i], z[i]
            used += 1
    return x_out[:used], y_out[:used], z_out[:used]


@nb.njit(cache=True, nogil=True)
def _columns(points):  # type: ignore[no-untyped-def]
    """Return the columns of points (N, 4), each by itself."""
    size = points.shape[0]
    a, b, c, d = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        a[i], b[i], c[i], d[i] = points[i, 0], points[i, 1], points[i, 2], points[i, 3]
    return a, b, c, d


@nb.njit(cache=True, nogil=True, fastmath={"reassoc", "nsz"})
def _near_sum(x, y, z, model, near_m):  # type: ignore[no-untyped-def]
    """Return how many points (K,) lie on a face: 1 for each that is on it, less for those that are off, down to 0."""
    a, b, c = model
    total, per_m = 0.0, 1.0 / near_m
    for i in range(x.size):
        total += max(1.0 - abs(x[i] - (a + b * y[i] + c * z[i])) * per_m, 0.0)
    return total


@nb.njit(cache=True, nogil=True)
def _plane(x, y, z, pick):  # type: ignore[no-untyped-def]
    """Return a, b, c of the face through three points; NaN where it is none or no likely one."""
    i, j, k = pick
    x1, y1, z1 = x[j] - x[i], y[j] - y[i], z[j] - z[i]
    x2, y2, z2 = x[k] - x[i], y[k] - y[i], z[k] - z[i]
    det = y1 * z2 - y2 * z1
    if abs(det) <= 1e-3:
        return math.nan, math.nan, math.nan
    b, c = (x1 * z2 - x2 * z1) / det, (y1 * x2 - y2 * x1) / det
    if c <= STEEPEST or c >= _FLATTEST or abs(b) >= _MOST_ASKEW:
        return math.nan, math.nan, math.nan
    return x[i] - b * y[i] - c * z[i], b, c


@nb.njit(cache=True, nogil=True)
def _most_on(x, y, z, picks, known):  # type: ignore[no-untyped-def]
    """Return a, b, c of the face with the best score of those through `picks` (K, 3) and of `known` (L, 3); NaN: none."""
    best, most = np.zeros(3), -1.0
    best[0] = math.nan
    for i in range(picks.shape[0] + known.shape[0]):
        if i < picks.shape[0]:
            model = _plane(x, y, z, (picks[i, 0], picks[i, 1], picks[i, 2]))
        else:
            last = known[i - picks.shape[0]]
            model = (last[0], last[1], last[2])
        if math.isnan(model[0]):
            continue
        # a flat model needs room along x for its rocks; it must not win by that
        wider = max(1.0, abs(model[2]))
        score = _near_sum(x, y, z, model, _NEAR_M * wider) / math.sqrt(wider)
        if score > most:
            best[0], best[1], best[2] = model
            most = score
    return best


@nb.njit(cache=True, nogil=True)
def _regression(points, start, scale_variance, pitch_variance):  # type: ignore[no-untyped-def]
    """Return a, b, c, drift (4,), the information H (4, 4), the residuals' spread and the number of blocks."""
    columns = _columns(points)
    _centre(columns[3])
    weights = _cell_weights(columns[1], columns[2])
    blocks_of, most_blocks = cell_numbers(columns[1], columns[2], BLOCK_M)
    off, model, H = np.empty(weights.size), np.zeros(4), np.zeros((4, 4))
    model[0], model[1], model[2] = start[0], start[1], start[2]
    spread, blocks = 0.3, 1
    for _ in range(12):
        spread = max(_residuals(columns, model, weights, off), 0.02 * max(1.0, abs(model[2])))
        H, g, blocks = _equations(columns, off, weights, spread, (blocks_of, most_blocks))
        # scale and pitch move the hits of a face alike: x by e s and, a pitch error d, by c d times the distance
        drift_variance = scale_variance + model[2] ** 2 * pitch_variance + 1e-10
        prior = (0.0, 1.0 / 0.7**2, 1e-6, 1.0 / drift_variance)
        for k in range(4):
            H[k, k] += prior[k]
            g[k] -= prior[k] * model[k] if k != 2 else 0.0
        change = _solved(H, g)
        for k in range(4):
            model[k] += change[k]
        if max(abs(change[0]), abs(change[1]), abs(change[2])) < 1e-4:
            break
    return model, H, spread, blocks


@nb.njit(cache=True, nogil=True)
def _residuals(columns, model, weights, off):  # type: ignore[no-untyped-def]
    """Fill `off` with how far the hits lie behind the face along x; return their spread: 1.4826 times the median of its size."""
    x, y, z, s = columns
    apart, mass = np.empty(off.size), np.empty(off.size)
    for i in range(off.size):
        off[i] = x[i] - (model[0] + model[1] * y[i] + model[2] * z[i] + model[3] * s[i])
        apart[i], mass[i] = abs(off[i]), weights[i]
    return 1.4826 * weighted_median(apart, mass)


@nb.njit(cache=True, nogil=True)
def _equations(columns, off, weights, spread, blocks):  # type: ignore[no-untyped-def]
    """Return H (4, 4) and g (4,) of Tukey's weights, as if each block with a hit that counts were one, and how many these are."""
    H, g, J = np.zeros((4, 4)), np.zeros(4), np.ones(4)
    seen, count, total = np.zeros(blocks[1], np.bool_), 0, 0.0
    for i in range(off.size):
        u = off[i] / (_TUKEY * spread)
        if abs(u) >= 1.0:
            continue
        w = weights[i] * (1.0 - u * u) ** 2
        total += w
        count += not seen[blocks[0][i]]
        seen[blocks[0][i]] = True
        J[1], J[2], J[3] = columns[1][i], columns[2][i], columns[3][i]
        for k in range(4):
            g[k] += w * off[i] * J[k]
            for m in range(k + 1):
                H[k, m] += w * J[k] * J[m]
    count = max(count, 1)
    scale = count / max(total, 1e-9) / spread**2
    for k in range(4):
        g[k] *= scale
        for m in range(k + 1):
            H[k, m] *= scale
            H[m, k] = H[k, m]
    return H, g, count


@nb.njit(cache=True, nogil=True)
def _centre(values):  # type: ignore[no-untyped-def]
    """Subtract the mean."""
    middle = 0.0
    for value in values:
        middle += value / values.size
    for i in range(values.size):
        values[i] -= middle


@nb.njit(cache=True, nogil=True)
def _cell_weights(y, z):  # type: ignore[no-untyped-def]
    """Return weights (N,) that add up to 1 in each cell: near hits are many and must not outvote."""
    numbers, count = cell_numbers(y, z, CELL_M)
    hits, weights = np.zeros(count), np.empty(y.size)
    for number in numbers:
        hits[number] += 1.0
    for i in range(y.size):
        weights[i] = 1.0 / hits[numbers[i]]
    return weights


@nb.njit(cache=True, nogil=True)
def _solved(H, g):  # type: ignore[no-untyped-def]
    """Return the solution (4,) of H x = g, H symmetric and positive definite: elimination needs no pivots."""
    A, x = H.copy(), g.copy()
    for k in range(4):
        for i in range(k + 1, 4):
            factor = A[i, k] / A[k, k]
            x[i] -= factor * x[k]
            for j in range(k, 4):
                A[i, j] -= factor * A[k, j]
    for k in range(3, -1, -1):
        for j in range(k + 1, 4):
            x[k] -= A[k, j] * x[j]
        x[k] /= A[k, k]
    return x
