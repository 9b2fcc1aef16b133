"""Range flow between two scans: the motion that makes the change of the ranges agree with a rigid world.

Re-derived from the range flow constraint (Jaimez et al., RF2O, ICRA 2016): for a scan R(t, theta) of a static world, seen by
a scanner that moves with (v_x, v_y, w) in its own frame,

    (cos th + R_th sin th / r) v_x + (sin th - R_th cos th / r) v_y - R_th w + R_t = 0

The scanner is the origin, so the term x sin th - y cos th of the general form is zero; mounts are applied outside. What
differs from the published method: gradients are least squares lines over a width in metres (`flow_scan`); scans are warped
exactly, as chains of wall segments, and in both directions, so that the estimate does not lock to the beams' spacing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.flow_scan import Pyramid
from lhdmap.odometry.matching import solve3

CAUCHY_SIGMAS = 3.0
GRAZING_WEIGHT = 0.1  # part of the squared slope by which the variance grows: discounts grazing beams and edges
_FEWEST_BEAMS = 12.0
_CONVERGED_M = 1e-4


class Flow(NamedTuple):
    """Motion between two scans and how sure it is.

    `T_reference_current` (3,); `information` (3, 3) of the twist about the reference (gradients that are only noise do not
    count); residual in sigmas (rms); share of beams that agree.
    """

    T_reference_current: FloatArray
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
        pose = result.T_reference_current
    return result


@nb.njit(cache=True, nogil=True)
def _solve(reference, current, start, guess, prior_information, noise_m, iterations):  # type: ignore[no-untyped-def]
    """Iteratively reweighted least squares with a Cauchy kernel on one level, both directions of warping."""
    pose = start.copy()
    H, N, b = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    scale, weights, squares, count = 1.0, 0.0, 0.0, 0.0
    for _ in range(iterations):
        H[:] = 0.0
        N[:] = 0.0
        b[:] = 0.0
        w1, s1, n1 = accumulate(pose, current, reference, 1.0, noise_m, scale, H, N, b)
        w2, s2, n2 = accumulate(se2.inverse(pose), reference, current, -1.0, noise_m, scale, H, N, b)
        weights, squares, count = w1 + w2, s1 + s2, n1 + n2
        if count < _FEWEST_BEAMS:
            H[:] = 0.0
            break
        _complete(H)
        b *= 0.5
        step = solve3(H + prior_information, b + prior_information @ (guess - pose))
        pose = se2.compose(step, pose)
        pose[2] = guess[2] + se2.wrap(pose[2] - guess[2])
        scale = max(squares / max(weights, 1.0), 0.25)
        if abs(step[0]) + abs(step[1]) + 4.0 * abs(step[2]) < _CONVERGED_M:
            break
    beams = max(current.range_m.size + reference.range_m.size, 1)
    return pose, _true_information(H, N), math.sqrt(squares / max(weights, 1.0)), weights / beams


@nb.njit(cache=True, nogil=True)
def _complete(H):  # type: ignore[no-untyped-def]
    """Mirror the upper part; halve, for each wall point entered twice."""
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    H *= 0.5


@nb.njit(cache=True, nogil=True)
def _true_information(H, N):  # type: ignore[no-untyped-def]
    """Return what H (3, 3) is worth when its part N comes from noise of the gradients: T H^-1 T with T = H - N, T >= 0.

    In smooth walls most of H along the drift is such noise: taken for information it would hold any wrong motion fast.
    """
    if H[0, 0] <= 0.0:
        return H
    _complete(N)
    scale = np.sqrt(np.diag(H)) + 1e-12
    values, vectors = np.linalg.eigh((H - N) / np.outer(scale, scale))
    T = np.outer(scale, scale) * ((vectors * np.maximum(values, 0.0)) @ vectors.T)
    return T @ np.linalg.inv(H + np.diag(1e-9 * scale * scale)) @ T


@nb.njit(cache=True, nogil=True)
def accumulate(T_target_source, source, target, sign, noise_m, scale, H, N, b):  # type: ignore[no-untyped-def]
    """Add the constraints of all beams of `source`, warped onto `target`, to H and N (upper parts) and b.

    N is the part of H that noise of the slopes gives on average.
    The unknown is the twist that moves T_reference_current from the left. With `sign` -1 the reference is the source: the
    twist then moves the target's frame, its sign and axes turn. Returns (robust weights, weighted square sum, beams).
    """
    tx, ty = T_target_source[0], T_target_source[1]
    c, s = math.cos(T_target_source[2]), math.sin(T_target_source[2])
    weights, squares, count = 0.0, 0.0, 0.0
    h00 = h01 = h02 = h11 = h12 = h22 = b0 = b1 = b2 = 0.0
    n00 = n01 = n02 = n11 = n12 = n22 = 0.0
    j = 0
    for i in range(source.range_m.size):
        if source.slope[i] == 0.0:
            continue
        xs, ys = source.range_m[i] * source.cos[i], source.range_m[i] * source.sin[i]
        x, y = tx + c * xs - s * ys, ty + s * xs + c * ys
        j, f, usable = _segment_at(target, x, y, j)
        if not usable:
            continue
        # where the beam through (x, y) meets the wall segment between beams j and j + 1
        ax, ay = target.range_m[j] * target.cos[j], target.range_m[j] * target.sin[j]
        ex, ey = target.range_m[j + 1] * target.cos[j + 1] - ax, target.range_m[j + 1] * target.sin[j + 1] - ay
        det = x * ey - y * ex
        if det == 0.0:
            continue
        warped = math.sqrt(x * x + y * y)
        residual = warped - warped * (ax * ey - ay * ex) / det
        slope = 0.5 * (source.slope[i] + (1.0 - f) * target.slope[j] + f * target.slope[j + 1])
        bend = max(source.bend_m[i], target.bend_m[j], target.bend_m[j + 1])
        variance = noise_m * noise_m * (1.0 + GRAZING_WEIGHT * slope * slope) + bend * bend
        robust = 1.0 / (1.0 + residual * residual / (variance * scale * CAUCHY_SIGMAS * CAUCHY_SIGMAS))
        w = robust / variance
        ct, st = x / warped, y / warped
        g0, g1, g2 = ct + slope * st, st - slope * ct, -slope * warped
        # how the row moves with the slope, and the variance of the mean of two slopes
        k0, k1, k2 = st, -ct, -warped
        wn = w * noise_m * noise_m * 0.25 * (source.slope_gain[i] + min(target.slope_gain[j], target.slope_gain[j + 1]))
        if sign < 0.0:
            g2 = g2 - tx * g1 + ty * g0
            g0, g1 = c * g0 + s * g1, -s * g0 + c * g1
            k2 = k2 - tx * k1 + ty * k0
            k0, k1 = c * k0 + s * k1, -s * k0 + c * k1
        n00 += wn * k0 * k0
        n01 += wn * k0 * k1
        n02 += wn * k0 * k2
        n11 += wn * k1 * k1
        n12 += wn * k1 * k2
        n22 += wn * k2 * k2
        h00 += w * g0 * g0
        h01 += w * g0 * g1
        h02 += w * g0 * g2
        h11 += w * g1 * g1
        h12 += w * g1 * g2
        h22 += w * g2 * g2
        signed = w * residual * sign
        b0 -= signed * g0
        b1 -= signed * g1
        b2 -= signed * g2
        weights += robust
        squares += w * residual * residual
        count += 1.0
    H[0, 0] += h00
    H[0, 1] += h01
    H[0, 2] += h02
    H[1, 1] += h11
    H[1, 2] += h12
    H[2, 2] += h22
    N[0, 0] += n00
    N[0, 1] += n01
    N[0, 2] += n02
    N[1, 1] += n11
    N[1, 2] += n12
    N[2, 2] += n22
    b[0] += b0
    b[1] += b1
    b[2] += b2
    return weights, squares, count


@nb.njit(cache=True, nogil=True)
def _segment_at(scan, x, y, hint):  # type: ignore[no-untyped-def]
    """Return the beam j whose wall segment to j + 1 the direction of (x, y) falls on, where in it, and whether there is one.

    Points come in the order of their angle, so the search walks on from the last place, `hint`.
    """
    n = scan.range_m.size
    j = hint
    while j < n - 2 and scan.cos[j + 1] * y - scan.sin[j + 1] * x > 0.0:
        j += 1
    while j > 0 and scan.cos[j] * y - scan.sin[j] * x < 0.0:
        j -= 1
    before, after = scan.cos[j] * y - scan.sin[j] * x, scan.cos[j + 1] * y - scan.sin[j + 1] * x
    inside = before >= 0.0 and after < 0.0 and scan.cos[j] * x + scan.sin[j] * y > 0.0
    usable = inside and scan.joined[j] != 0.0 and scan.slope[j] != 0.0 and scan.slope[j + 1] != 0.0
    return j, before / (before - after) if usable else 0.0, usable
