"""Range flow between two scans: the motion that makes the change of the ranges agree with a rigid world.

Re-derived from the range flow constraint (Jaimez et al., RF2O, ICRA 2016): for a scan R(t, theta) of a static world, seen by
a scanner that moves with (v_x, v_y, w) in its own frame,

    (cos th + R_th sin th / r) v_x + (sin th - R_th cos th / r) v_y - R_th w + R_t = 0

The scanner is the origin, so the term x sin th - y cos th of the general form is zero; mounts are applied outside. What
differs from the published method: gradients are least squares lines over a width in metres (`scan`); scans are warped
exactly, as chains of wall segments, and in both directions, so that the estimate does not lock to the beams' spacing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.range_flow.rows import ROWS, SUMS, add_up, add_up_noise, warp
from lhdmap.odometry.range_flow.scan import Pyramid
from lhdmap.scan_matching.equations import solve3

_FEWEST_BEAMS = 12  # equations: four for each unknown
_CONVERGED_M = 5e-4  # a quarter of a pair's error: measured, stopping later gains nothing
_REWEIGHTINGS = 4  # on one warp at most
_LEAST_SCALE = 0.25  # of the variances: a scan against itself has no residuals, and no scale
_HEADING_ARM_M = 4.0  # by which a turn counts as a step


class Flow(NamedTuple):
    """Motion between two scans and how sure it is.

    `pose_reference_current` (3,); `information` (3, 3) of the twist about the reference (gradients that are only noise do not
    count); residual in sigmas (rms); share of beams that agree.
    """

    pose_reference_current: FloatArray
    information: FloatArray
    residual_sigmas: float
    support: float


def flow(
    reference: Pyramid,
    current: Pyramid,
    guess: FloatArray,
    prior_information: FloatArray,
    noise_m: float,
    *,
    coarsest: int = 0,
    iterations: int = 6,
) -> Flow:
    """Estimate the motion from `reference` to `current` (pyramids), from level `coarsest` down to 0.

    `guess` (3,) and `prior_information` (3, 3) are the prior. Where a scan has no beams, the guess comes back with no information.
    """
    pose = guess.copy()
    coarsest = min(coarsest, reference.coarsest, current.coarsest)
    result = Flow(pose, np.zeros((3, 3)), math.nan, 0.0)
    for level in range(coarsest, -1, -1):
        step = _solve(reference.level(level), current.level(level), pose, guess, prior_information, noise_m, iterations)
        result = Flow(*step)
        pose = result.pose_reference_current
    return result


@nb.njit(cache=True, nogil=True)
def _solve(reference, current, start, guess, prior_information, noise_m, iterations):  # type: ignore[no-untyped-def]
    """Gauss-Newton on one level, warping in both directions; returns the fields of `Flow`."""
    pose, twist, scale = start.copy(), np.zeros(3), 1.0
    if min(current.shape[0], reference.shape[0]) < _FEWEST_BEAMS:
        return pose, np.zeros((3, 3)), math.nan, 0.0
    table = np.empty((ROWS, current.shape[0] + reference.shape[0]))
    forth, back = np.full(current.shape[0], -1), np.full(reference.shape[0], -1)
    H, N, b, turn = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.eye(3)
    weights, squares, middle, end = 0.0, 0.0, 0, 0
    for _ in range(iterations):
        pose_current_reference = se2.inverse(pose)
        middle = warp(pose, current, reference, noise_m, forth, table, 0)
        end = warp(pose_current_reference, reference, current, noise_m, back, table, middle)
        if end < _FEWEST_BEAMS:
            return pose, np.zeros((3, 3)), math.nan, 0.0
        _fill_turn(pose_current_reference, turn)
        toward = prior_information @ (guess - pose)
        twist[:] = 0.0
        for _ in range(_REWEIGHTINGS):
            weights, squares = _normal_equations(table, middle, end, turn, twist, scale, H, b)
            change = solve3(H + prior_information, b + toward) - twist
            twist += change
            scale = max(squares / max(weights, 1.0), _LEAST_SCALE)
            if _size_m(change) < _CONVERGED_M:
                break
        pose = se2.compose(twist, pose)
        pose[2] = guess[2] + se2.wrap(pose[2] - guess[2])
        if _size_m(twist) < _CONVERGED_M:
            break
    _noise_part(table, middle, end, turn, twist, scale, noise_m, N)
    beams = max(current.shape[0] + reference.shape[0], 1)
    return pose, _true_information(H, N), math.sqrt(squares / max(weights, 1.0)), weights / beams


@nb.njit(cache=True, nogil=True)
def _size_m(twist):  # type: ignore[no-untyped-def]
    return abs(twist[0]) + abs(twist[1]) + _HEADING_ARM_M * abs(twist[2])


@nb.njit(cache=True, nogil=True)
def _fill_turn(T, turn):  # type: ignore[no-untyped-def]
    """Fill `turn` (3, 3): a twist of `pose_reference_current` from the left, as the twist of its inverse `T` from the left."""
    c, s = math.cos(T[2]), math.sin(T[2])
    turn[0, 0], turn[0, 1], turn[0, 2] = -c, s, -T[1]
    turn[1, 0], turn[1, 1], turn[1, 2] = -s, -c, T[0]
    turn[2, 0], turn[2, 1], turn[2, 2] = 0.0, 0.0, -1.0


@nb.njit(cache=True, nogil=True)
def _normal_equations(table, middle, end, turn, twist, scale, H, b):  # type: ignore[no-untyped-def]
    """Fill H (3, 3) and b (3,) from both directions; halved, for each wall point enters twice. Returns (weights, squares)."""
    forth, back = np.empty(SUMS), np.empty(SUMS)
    add_up(table, 0, middle, twist, scale, forth)
    add_up(table, middle, end, turn @ twist, scale, back)
    H[:] = 0.5 * (_symmetric(forth) + turn.T @ _symmetric(back) @ turn)
    b[:] = 0.5 * (forth[6:9] + turn.T @ back[6:9])
    return forth[9] + back[9], forth[10] + back[10]


@nb.njit(cache=True, nogil=True)
def _noise_part(table, middle, end, turn, twist, scale, noise_m, N):  # type: ignore[no-untyped-def]
    """Fill N (3, 3): the part of H that noise of the slopes gives on average."""
    forth, back = np.empty(6), np.empty(6)
    add_up_noise(table, 0, middle, twist, scale, noise_m, forth)
    add_up_noise(table, middle, end, turn @ twist, scale, noise_m, back)
    N[:] = 0.5 * (_symmetric(forth) + turn.T @ _symmetric(back) @ turn)


@nb.njit(cache=True, nogil=True)
def _symmetric(upper):  # type: ignore[no-untyped-def]
    """Return the matrix (3, 3) whose upper part comes first in `upper`."""
    return np.array([[upper[0], upper[1], upper[2]], [upper[1], upper[3], upper[4]], [upper[2], upper[4], upper[5]]])


@nb.njit(cache=True, nogil=True)
def _true_information(H, N):  # type: ignore[no-untyped-def]
    """Return what H (3, 3) is worth when its part N comes from noise of the gradients: T H^-1 T with T = H - N, T >= 0.

    In smooth walls most of H along the drift is such noise: taken for information it would hold any wrong motion fast.
    """
    scale = np.sqrt(np.diag(H)) + 1e-12
    values, vectors = np.linalg.eigh((H - N) / np.outer(scale, scale))
    T = np.outer(scale, scale) * ((vectors * np.maximum(values, 0.0)) @ vectors.T)
    return T @ np.linalg.inv(H + np.diag(1e-9 * scale * scale)) @ T
