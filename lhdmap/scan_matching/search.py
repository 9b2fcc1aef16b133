"""Wide search for a scan's pose: a likelihood field of recent hits, all headings and shifts in reach, coarse to fine.

Used where the prediction cannot be trusted: at the start, after a blackout, at jumps. It is cheap enough for single scans and
far too slow for each; what it finds is a start for `lhdmap.scan_matching.matching`, never a result.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import Float32Array, FloatArray

FIELD_HALF_M = 25.0
_SPREAD_CELLS = 2


@nb.njit(cache=True, nogil=True)
def likelihood_field(hits_m: FloatArray, centre_m: FloatArray, cell_m: float) -> Float32Array:
    """Return a square field around `centre_m` (2,): 1 at recent hits, shape (M, 2), falling off over two cells."""
    size = int(2.0 * FIELD_HALF_M / cell_m)
    field = np.zeros((size, size), dtype=np.float32)
    for k in range(hits_m.shape[0]):
        ix = int(math.floor((hits_m[k, 0] - centre_m[0] + FIELD_HALF_M) / cell_m))
        iy = int(math.floor((hits_m[k, 1] - centre_m[1] + FIELD_HALF_M) / cell_m))
        if not (_SPREAD_CELLS <= ix < size - _SPREAD_CELLS and _SPREAD_CELLS <= iy < size - _SPREAD_CELLS):
            continue
        for dx in range(-_SPREAD_CELLS, _SPREAD_CELLS + 1):
            for dy in range(-_SPREAD_CELLS, _SPREAD_CELLS + 1):
                value = np.float32(math.exp(-0.5 * (dx * dx + dy * dy)))
                field[ix + dx, iy + dy] = max(field[ix + dx, iy + dy], value)
    return field


@nb.njit(cache=True, nogil=True)
def score(field, centre_m, cell_m, points, pose):  # type: ignore[no-untyped-def]
    """Return the mean likelihood of points (N, 2), base frame, at `pose`."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    size = field.shape[0]
    total = 0.0
    for i in range(points.shape[0]):
        ix = int((pose[0] + c * points[i, 0] - s * points[i, 1] - centre_m[0] + FIELD_HALF_M) / cell_m)
        iy = int((pose[1] + s * points[i, 0] + c * points[i, 1] - centre_m[1] + FIELD_HALF_M) / cell_m)
        if 0 <= ix < size and 0 <= iy < size:
            total += field[ix, iy]
    return total / points.shape[0]


@nb.njit(cache=True, nogil=True)
def search(hits_m, points, predicted, prior_information, reach, cell_m, step_rad):  # type: ignore[no-untyped-def]
    """Return the best poses, shape (K, 3), best first, around `predicted` (3,).

    `reach`: largest shift (m) and turn (rad); the prior `prior_information` (3, 3) only breaks near ties, so that a drift that
    looks the same everywhere does not draw the pose away.
    """
    field = likelihood_field(hits_m, predicted[:2], cell_m)
    shifts = int(math.ceil(reach[0] / (2.0 * cell_m)))
    turns = int(math.ceil(reach[1] / step_rad))
    best = np.full((5, 4), -1e30)
    for k in range(-turns, turns + 1):
        top = np.full(4, -1e30)
        pose = predicted.copy()
        pose[2] += k * step_rad
        for i in range(-shifts, shifts + 1):
            for j in range(-shifts, shifts + 1):
                pose[0], pose[1] = predicted[0] + 2.0 * cell_m * i, predicted[1] + 2.0 * cell_m * j
                value = score(field, predicted[:2], cell_m, points, pose) + _tie(pose - predicted, prior_information)
                if value > top[0]:
                    top[0], top[1], top[2], top[3] = value, pose[0], pose[1], pose[2]
        _keep(best, top, 3.0 * step_rad)
    for k in range(best.shape[0]):
        if best[k, 0] > -1e29:
            _climb(field, predicted, cell_m, points, prior_information, step_rad, best[k])
    return best[np.argsort(-best[:, 0]), 1:]


@nb.njit(cache=True, nogil=True)
def _tie(error, information):  # type: ignore[no-untyped-def]
    """Return the prior's small say: at most 0.15 of a likelihood of 1."""
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += error[i] * information[i, j] * error[j]
    return -0.15 * square / (square + 20.0)


@nb.njit(cache=True, nogil=True)
def _keep(best, top, apart_rad):  # type: ignore[no-untyped-def]
    """Put `top` among the best, one for each neighbourhood in heading."""
    for k in range(best.shape[0]):
        if best[k, 0] > -1e29 and abs(best[k, 3] - top[3]) < apart_rad:
            if top[0] > best[k, 0]:
                best[k] = top
            return
    worst = np.argmin(best[:, 0])
    if top[0] > best[worst, 0]:
        best[worst] = top


@nb.njit(cache=True, nogil=True)
def _climb(field, predicted, cell_m, points, information, step_rad, entry):  # type: ignore[no-untyped-def]
    """Refine one candidate by coordinate steps that halve, in place."""
    shift, turn = cell_m, 0.5 * step_rad
    pose = entry[1:].copy()
    value = entry[0]
    for _ in range(3):
        improved = True
        while improved:
            improved = False
            for axis in range(3):
                for sign in (-1.0, 1.0):
                    trial = pose.copy()
                    trial[axis] += sign * (turn if axis == 2 else shift)
                    trial_value = score(field, predicted[:2], cell_m, points, trial) + _tie(
                        trial - predicted, information
                    )
                    if trial_value > value + 1e-6:
                        pose, value, improved = trial, trial_value, True
        shift *= 0.5
        turn *= 0.5
    entry[0] = value
    entry[1:] = pose
