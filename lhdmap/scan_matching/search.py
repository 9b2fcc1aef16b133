"""Wide search for a scan's pose: a likelihood field of recent hits, all headings and shifts in reach, coarse to fine.

Used where the prediction cannot be trusted: at the start, after a blackout, at jumps. It is cheap enough for single scans and
far too slow for each; what it finds is a start for `lhdmap.scan_matching.matching`, never a result.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import Float32Array, FloatArray

FIELD_HALF_M = 25.0
_SPREAD_CELLS = 2
_APART_STEPS = 3.0  # of the heading: nearer ones are one neighbourhood


class SearchGrid(NamedTuple):
    """How finely a search looks: cells of the likelihood field, step of the heading, hits of the scan that are used.

    It finds `starts` poses at most. Of two poses with one heading and less than `apart_m` between them, the better one counts.
    """

    cell_m: float = 0.1
    step_rad: float = math.radians(2.0)
    beams: int = 120
    starts: int = 5
    apart_m: float = 2.0


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
def search(hits_m, points, predicted, information, reach, grid):  # type: ignore[no-untyped-def]
    """Return poses to start matches from, shape (K, 3), best first, around `predicted` (3,); none where no hit meets a wall.

    Args:
        hits_m: what is known of the place, shape (M, 2) or more columns.
        points: hits of the scan in its own frame, shape (N, 2) or more columns, N > 0.
        predicted: pose in the frame of `hits_m`.
        information: of the prediction (3, 3); it only breaks near ties, so that a drift that looks the same everywhere does
            not draw the pose away.
        reach: largest shift (m) and turn (rad).
        grid: `SearchGrid`.
    """
    field = likelihood_field(hits_m, predicted[:2], grid.cell_m)
    shifts = int(math.ceil(reach[0] / (2.0 * grid.cell_m)))
    turns = int(math.ceil(reach[1] / grid.step_rad))
    best, kept = np.zeros((grid.starts, 4)), 0
    for k in range(-turns, turns + 1):
        values = _values(field, points, predicted, information, k * grid.step_rad, shifts, grid.cell_m)
        kept = _peaks(values, predicted, k * grid.step_rad, grid, best, kept)
    usable = 0
    for k in range(kept):
        _climb(field, predicted, grid.cell_m, points, information, grid.step_rad, best[k])
        if score(field, predicted[:2], grid.cell_m, points, best[k, 1:]) > 0.0:
            best[usable] = best[k]
            usable += 1
    return best[np.argsort(-best[:usable, 0]), 1:]


@nb.njit(cache=True, nogil=True)
def _values(field, points, predicted, information, turn_rad, shifts, cell_m):  # type: ignore[no-untyped-def]
    """Return the likelihood at all shifts with one heading, each two cells from the next, ties broken."""
    values, pose = np.empty((2 * shifts + 1, 2 * shifts + 1)), predicted.copy()
    pose[2] += turn_rad
    for i in range(-shifts, shifts + 1):
        for j in range(-shifts, shifts + 1):
            pose[0], pose[1] = predicted[0] + 2.0 * cell_m * i, predicted[1] + 2.0 * cell_m * j
            value = score(field, predicted[:2], cell_m, points, pose)
            values[i + shifts, j + shifts] = value + _tie(pose - predicted, information)
    return values


@nb.njit(cache=True, nogil=True)
def _peaks(values, predicted, turn_rad, grid, best, kept):  # type: ignore[no-untyped-def]
    """Put the best shifts of one heading, apart from each other, among the best of all; return how many these are."""
    size = values.shape[0]
    apart = grid.apart_m / (2.0 * grid.cell_m)
    entry = np.empty(4)
    for _ in range(grid.starts):
        at = np.argmax(values)
        top_i, top_j = at // size, at % size
        if values[top_i, top_j] == -np.inf:
            break
        entry[0] = values[top_i, top_j]
        entry[1] = predicted[0] + 2.0 * grid.cell_m * (top_i - size // 2)
        entry[2] = predicted[1] + 2.0 * grid.cell_m * (top_j - size // 2)
        entry[3] = predicted[2] + turn_rad
        kept = _keep(best, kept, entry, grid)
        for i in range(size):
            for j in range(size):
                if (i - top_i) ** 2 + (j - top_j) ** 2 < apart * apart:
                    values[i, j] = -np.inf
    return kept


@nb.njit(cache=True, nogil=True)
def _tie(error, information):  # type: ignore[no-untyped-def]
    """Return the prior's small say: at most 0.15 of a likelihood of 1."""
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += error[i] * information[i, j] * error[j]
    return -0.15 * square / (square + 20.0)


@nb.njit(cache=True, nogil=True)
def _keep(best, kept, entry, grid):  # type: ignore[no-untyped-def]
    """Put an entry among the best, one for each neighbourhood; return how many these are."""
    for k in range(kept):
        near = (best[k, 1] - entry[1]) ** 2 + (best[k, 2] - entry[2]) ** 2 < grid.apart_m**2
        if near and abs(best[k, 3] - entry[3]) < _APART_STEPS * grid.step_rad:
            if entry[0] > best[k, 0]:
                best[k] = entry
            return kept
    if kept < best.shape[0]:
        best[kept] = entry
        return kept + 1
    worst = np.argmin(best[:, 0])
    if entry[0] > best[worst, 0]:
        best[worst] = entry
    return kept


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
