"""The equations of range flow: each beam of one scan, warped onto the other, says one thing about the motion.

They are linear in the motion near the pose of the warp, so reweighting runs on stored rows, several times a warp.
"""

from __future__ import annotations

import math

import numba as nb

from lhdmap.odometry.range_flow.scan import BEND, GAIN, SLOPE, WALL, X, Y

CAUCHY_SIGMAS = 3.0  # at which a residual has half its weight: edges and moving things count less, walls hardly
# Parts of the squared slope and of the mean square about the wall's line by which a residual's variance grows: grazing
# beams, edges and rough walls count less. Measured: best heading of a pair and best over 10 m in rough walls (tools/evaluate).
GRAZING_WEIGHT, BEND_WEIGHT = 0.3, 0.5

# Rows of the table of equations, shape (7, M): residual range (m), direction of the warped point as cosine and sine, slope
# and range (m) there, variance of the residual (m²), variance of the slope for a range noise of 1 m.
RESIDUAL, COS, SIN, SLOPE_THERE, RANGE, VARIANCE, SLOPE_GAIN = range(7)
ROWS = 7  # their number
# What `add_up` gives: H00 H01 H02 H11 H12 H22 b0 b1 b2, sum of robust weights, weighted square sum.
SUMS = 11


@nb.njit(cache=True, nogil=True, error_model="numpy")
def warp(pose_target_source, source, target, noise_m, places, table, start):  # type: ignore[no-untyped-def]
    """Write the equations of the beams of `source` (N, 6) on `target` to columns `start` and on of `table`; return their end.

    A beam's residual is the range of its warped point less that of the wall segment which the direction of the point falls
    on. `places` (N,): the segments of the last warp, where the search starts (-1: none); replaced.
    """
    tx, ty = pose_target_source[0], pose_target_source[1]
    c, s = math.cos(pose_target_source[2]), math.sin(pose_target_source[2])
    noise2 = noise_m * noise_m
    j, k = 0, start
    for i in range(source.shape[0]):
        own = source[i, SLOPE]
        if own == 0.0:
            continue
        x, y = tx + c * source[i, X] - s * source[i, Y], ty + s * source[i, X] + c * source[i, Y]
        j = segment_at(target, x, y, j if places[i] < 0 else places[i])
        places[i] = j
        if target[j, WALL] == 0.0:
            continue
        ax, ay = target[j, X], target[j, Y]
        ex, ey = target[j + 1, X] - ax, target[j + 1, Y] - ay
        across = 1.0 / (x * ey - y * ex)
        f, reach = (ax * y - ay * x) * across, (ax * ey - ay * ex) * across
        if not (0.0 <= f <= 1.0 and reach > 0.0):
            continue
        before, after = target[j, SLOPE], target[j + 1, SLOPE]
        slope = 0.5 * (own + before + f * (after - before))
        warped2 = x * x + y * y
        inverse = 1.0 / math.sqrt(warped2)
        warped = warped2 * inverse
        table[RESIDUAL, k], table[RANGE, k] = warped - warped * reach, warped
        table[COS, k], table[SIN, k], table[SLOPE_THERE, k] = x * inverse, y * inverse, slope
        bend = max(source[i, BEND], target[j, BEND], target[j + 1, BEND])
        table[VARIANCE, k] = noise2 * (1.0 + GRAZING_WEIGHT * slope * slope) + BEND_WEIGHT * bend
        table[SLOPE_GAIN, k] = 0.25 * (source[i, GAIN] + min(target[j, GAIN], target[j + 1, GAIN]))
        k += 1
    return k


@nb.njit(cache=True, nogil=True)
def segment_at(scan, x, y, hint):  # type: ignore[no-untyped-def]
    """Return the beam j of `scan` whose wall segment to j + 1 the direction of (x, y) falls on, walking on from `hint`."""
    last, j = scan.shape[0] - 2, hint
    while j < last and scan[j + 1, X] * y - scan[j + 1, Y] * x > 0.0:
        j += 1
    while j > 0 and scan[j, X] * y - scan[j, Y] * x < 0.0:
        j -= 1
    return j


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def add_up(table, start, end, twist, scale, sums):  # type: ignore[no-untyped-def]
    """Write the normal equations of columns `start` to `end`, reweighted at `twist` (3,) of the target's frame, to `sums`.

    Cauchy weights; the unknown is the whole twist, not its change. `scale`: by how much the variances are too small.
    """
    t0, t1, t2 = twist[0], twist[1], twist[2]
    spread = 1.0 / (scale * CAUCHY_SIGMAS * CAUCHY_SIGMAS)
    h00 = h01 = h02 = h11 = h12 = h22 = b0 = b1 = b2 = weights = squares = 0.0
    residuals, cosines, sines = table[RESIDUAL], table[COS], table[SIN]
    slopes, ranges, variances = table[SLOPE_THERE], table[RANGE], table[VARIANCE]
    for k in range(start, end):
        ct, st, slope, variance = cosines[k], sines[k], slopes[k], variances[k]
        g0, g1, g2 = ct + slope * st, st - slope * ct, -slope * ranges[k]
        residual = residuals[k] + g0 * t0 + g1 * t1 + g2 * t2
        w = 1.0 / (variance + residual * residual * spread)
        h00 += w * g0 * g0
        h01 += w * g0 * g1
        h02 += w * g0 * g2
        h11 += w * g1 * g1
        h12 += w * g1 * g2
        h22 += w * g2 * g2
        wr = w * residuals[k]
        b0 -= wr * g0
        b1 -= wr * g1
        b2 -= wr * g2
        weights += w * variance
        squares += w * residual * residual
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = h00, h01, h02, h11, h12, h22
    sums[6], sums[7], sums[8], sums[9], sums[10] = b0, b1, b2, weights, squares


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def add_up_noise(table, start, end, twist, scale, noise_m, sums):  # type: ignore[no-untyped-def]
    """Write the part of H that noise of the slopes gives on average to `sums`; arguments as for `add_up`."""
    t0, t1, t2 = twist[0], twist[1], twist[2]
    spread = 1.0 / (scale * CAUCHY_SIGMAS * CAUCHY_SIGMAS)
    n00 = n01 = n02 = n11 = n12 = n22 = 0.0
    residuals, cosines, sines, gains = table[RESIDUAL], table[COS], table[SIN], table[SLOPE_GAIN]
    slopes, ranges, variances = table[SLOPE_THERE], table[RANGE], table[VARIANCE]
    for k in range(start, end):
        ct, st, slope, r = cosines[k], sines[k], slopes[k], ranges[k]
        residual = residuals[k] + (ct + slope * st) * t0 + (st - slope * ct) * t1 - slope * r * t2
        w = noise_m * noise_m * gains[k] / (variances[k] + residual * residual * spread)
        # a row moves with the slope by (sin, -cos, -range)
        n00 += w * st * st
        n01 -= w * st * ct
        n02 -= w * st * r
        n11 += w * ct * ct
        n12 += w * ct * r
        n22 += w * r * r
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = n00, n01, n02, n11, n12, n22
