"""Range flow between two scans: the motion that makes the change of the ranges agree with a rigid world.

Re-derived from the range flow constraint (Jaimez et al., RF2O, ICRA 2016): for a scan R(t, theta) of a static world seen by a
scanner that moves with (v_x, v_y, w) in its own frame,

    (cos th + R_th sin th / r) v_x + (sin th - R_th cos th / r) v_y - R_th w + R_t = 0

The scanner is the origin, so the term x sin th - y cos th of the general form is zero; mounts are applied outside. What
differs from the published code: any field of view, offset and order of angles; gradients are least squares lines over a
width in metres, not differences of neighbouring beams (whose noise makes small motions read wrongly); scans are warped
exactly, as chains of wall segments, and in both directions, so that the estimate does not lock to the beams' spacing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.geometry.se2 import inverse
from lhdmap.messages import FloatArray
from lhdmap.odometry.matching import solve3

JUMP_SLOPE = 14.0  # neighbours whose line to each other is steeper than this against the beam do not share a wall
CAUCHY_RESIDUALS = 3.0


class FlowScan(NamedTuple):
    """A scan prepared for range flow; arrays of shape (N,), beams in rising angle, invalid beams have range 0.

    `range_m`: local least squares range; `slope`: dR/dtheta / R of the wall there; `bend_m`: scatter of the hits about it;
    `joined`: 1 where beam i and i + 1 see the same wall.
    """

    angle_min_rad: float
    increment_rad: float
    cos: FloatArray
    sin: FloatArray
    range_m: FloatArray
    slope: FloatArray
    bend_m: FloatArray
    joined: FloatArray


@nb.njit(cache=True, nogil=True)
def prepare(ranges, angle_min, increment, range_min, range_max, width_m):  # type: ignore[no-untyped-def]
    """Return the FlowScan arrays (cos, sin, range, slope, bend, joined) of raw ranges with a positive increment."""
    n = ranges.size
    raw = np.zeros(n)
    for i in range(n):
        r = ranges[i]
        raw[i] = r if range_min <= r <= range_max and r < np.inf else 0.0
    joined = np.zeros(n)
    for i in range(n - 1):
        if raw[i] > 0.0 and raw[i + 1] > 0.0:
            nearer = min(raw[i], raw[i + 1])
            joined[i] = abs(raw[i + 1] - raw[i]) < JUMP_SLOPE * nearer * increment + 0.05
    cos, sin = np.empty(n), np.empty(n)
    for i in range(n):
        a = angle_min + i * increment
        cos[i], sin[i] = math.cos(a), math.sin(a)
    smooth, slope, bend = np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        if raw[i] > 0.0:
            _local_line(i, raw, cos, sin, joined, width_m, smooth, slope, bend)
    return cos, sin, smooth, slope, bend, joined


@nb.njit(cache=True, nogil=True)
def _local_line(i, raw, cos, sin, joined, width_m, smooth, slope, bend):  # type: ignore[no-untyped-def]
    """Fit the wall around beam i by u = a + b t in the beam's own axes (u along the beam, t across it), within `width_m`."""
    n = raw.size
    limit = width_m * width_m
    w0, wt, wu, wtt, wtu, wuu = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for side in (-1, 1):
        j = i
        for step in range(1, 25):
            if side < 0 and (j == 0 or joined[j - 1] == 0.0):
                break
            if side > 0 and (j == n - 1 or joined[j] == 0.0):
                break
            j += side
            px, py = raw[j] * cos[j], raw[j] * sin[j]
            u = px * cos[i] + py * sin[i] - raw[i]
            t = -px * sin[i] + py * cos[i]
            d2 = (u * u + t * t) / limit
            if d2 >= 1.0 and step > 1:
                break
            w = (1.0 - d2) * (1.0 - d2) if d2 < 1.0 else 0.0
            w = max(w, 0.2 if step == 1 else 0.0)  # sparse walls: the two neighbours still give the slope
            w0 += w
            wt += w * t
            wu += w * u
            wtt += w * t * t
            wtu += w * t * u
            wuu += w * u * u
    mt, mu = wt / w0, wu / w0
    stt = wtt / w0 - mt * mt
    if stt < 1e-10:
        return
    b = (wtu / w0 - mt * mu) / stt
    smooth[i] = raw[i] + mu - b * mt
    slope[i] = b
    bend[i] = math.sqrt(max(wuu / w0 - mu * mu - b * b * stt, 0.0))


@nb.njit(cache=True, nogil=True)
def accumulate(pose, source, target, sign, noise_m, scale, H, b):  # type: ignore[no-untyped-def]
    """Add the constraints of all beams of `source`, warped by `pose` (T_target_source, shape (3,)) onto `target`.

    `sign` -1 says that the motion wanted is the inverse of `pose` (the second direction of the symmetric constraint).
    Returns (robust weights, weighted square sum, beams).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    n = target.range_m.size
    sum_w, sum_wr, count = 0.0, 0.0, 0.0
    for i in range(source.range_m.size):
        r = source.range_m[i]
        if r == 0.0 or source.slope[i] == 0.0:
            continue
        xs, ys = r * source.cos[i], r * source.sin[i]
        x, y = pose[0] + c * xs - s * ys, pose[1] + s * xs + c * ys
        place = (math.atan2(y, x) - target.angle_min_rad) / target.increment_rad
        j = int(math.floor(place))
        if j < 0 or j >= n - 1 or target.joined[j] == 0.0 or target.slope[j] == 0.0 or target.slope[j + 1] == 0.0:
            continue
        # the beam through (x, y) meets the wall segment between beams j and j + 1
        ax, ay = target.range_m[j] * target.cos[j], target.range_m[j] * target.sin[j]
        ex, ey = target.range_m[j + 1] * target.cos[j + 1] - ax, target.range_m[j + 1] * target.sin[j + 1] - ay
        det = x * ey - y * ex
        if det == 0.0:
            continue
        warped = math.sqrt(x * x + y * y)
        seen = warped * (ax * ey - ay * ex) / det
        residual = warped - seen
        f = place - j
        slope = 0.5 * (source.slope[i] + (1.0 - f) * target.slope[j] + f * target.slope[j + 1])
        bend = max(source.bend_m[i], target.bend_m[j], target.bend_m[j + 1])
        variance = noise_m * noise_m * (1.0 + 0.1 * slope * slope) + bend * bend
        u2 = residual * residual / (variance * scale * CAUCHY_RESIDUALS * CAUCHY_RESIDUALS)
        robust = 1.0 / (1.0 + u2)
        w = robust / variance
        ct, st = x / warped, y / warped
        g0, g1, g2 = ct + slope * st, st - slope * ct, -slope * warped
        if sign < 0:
            # the same twist, seen from the other frame: it moves the target's frame, so the residual's sign turns too
            g2 = g2 - pose[0] * g1 + pose[1] * g0
            g0, g1 = c * g0 + s * g1, -s * g0 + c * g1
        H[0, 0] += w * g0 * g0
        H[0, 1] += w * g0 * g1
        H[0, 2] += w * g0 * g2
        H[1, 1] += w * g1 * g1
        H[1, 2] += w * g1 * g2
        H[2, 2] += w * g2 * g2
        r_signed = residual * sign
        b[0] -= w * g0 * r_signed
        b[1] -= w * g1 * r_signed
        b[2] -= w * g2 * r_signed
        sum_w += robust
        sum_wr += w * residual * residual
        count += 1.0
    return sum_w, sum_wr, count


@nb.njit(cache=True, nogil=True)
def estimate(reference, current, guess, prior_information, noise_m, iterations):  # type: ignore[no-untyped-def]
    """Return T_reference_current (3,), information H (3, 3) about the reference, residual rms in sigmas and used share.

    Iteratively reweighted least squares with a Cauchy kernel on both directions; `guess` is the prior's mean and
    `prior_information` (3, 3) its weight.
    """
    pose = guess.copy()
    H, b = np.zeros((3, 3)), np.zeros(3)
    scale, weights, squares, count = 1.0, 0.0, 0.0, 0.0
    for _ in range(iterations):
        H[:] = 0.0
        b[:] = 0.0
        w1, s1, n1 = accumulate(pose, current, reference, 1.0, noise_m, scale, H, b)
        w2, s2, n2 = accumulate(inverse(pose), reference, current, -1.0, noise_m, scale, H, b)
        weights, squares, count = w1 + w2, s1 + s2, n1 + n2
        if count < 12.0:
            break
        H *= 0.5  # each wall point entered twice
        b *= 0.5
        H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
        step = solve3(H + prior_information, b + prior_information @ (guess - pose))
        c, s = math.cos(step[2]), math.sin(step[2])
        x, y = pose[0], pose[1]
        pose[0], pose[1] = c * x - s * y + step[0], s * x + c * y + step[1]
        pose[2] += step[2]
        scale = max(squares / max(weights, 1.0), 0.25)
        if abs(step[0]) + abs(step[1]) + 4.0 * abs(step[2]) < 2e-5:
            break
    return pose, H, math.sqrt(squares / max(weights, 1.0)), weights / max(1.0 * current.range_m.size + reference.range_m.size, 1.0)
