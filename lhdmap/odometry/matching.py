"""Scan to map: Gauss-Newton on the distances of scan points to the walls' lines, with the motion's prediction as a prior."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.odometry.surface_map import SurfaceMap, fit_line


@nb.njit(cache=True, nogil=True)
def lines_at(map_: SurfaceMap, pose: FloatArray, points: FloatArray, spacing: FloatArray, lines: FloatArray) -> int:
    """Fit the wall's line at each scan point; return how many have one.

    `points` (N, 2) in base frame, `spacing` (N,) metres between neighbouring hits, `lines` (N, 7): as `fit_line` and the cell
    size of the level that served (0: none).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    found = 0
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        lines[i, 6] = 0.0
        if fit_line(map_.fine, x, y, lines[i]):
            lines[i, 6] = map_.fine.cell_m
        elif fit_line(map_.middle, x, y, lines[i]):
            lines[i, 6] = map_.middle.cell_m
        elif fit_line(map_.coarse, x, y, lines[i]):
            lines[i, 6] = map_.coarse.cell_m
        found += lines[i, 6] > 0.0
    return found


@nb.njit(cache=True, nogil=True)
def normal_equations(
    pose: FloatArray, points: FloatArray, lines: FloatArray, noise_m: float, cutoff: float, H: FloatArray, b: FloatArray
) -> FloatArray:
    """Fill H (3, 3) and b (3,) of the weighted distances at `pose`; H is in the map frame about the machine.

    Returns (weighted square sum, sum of robust weights, points with a line).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    H[:] = 0.0
    b[:] = 0.0
    total = weights = count = 0.0
    for i in range(points.shape[0]):
        if lines[i, 6] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, 2], lines[i, 3]
        d = nx * (pose[0] + rx - lines[i, 0]) + ny * (pose[1] + ry - lines[i, 1])
        r2 = rx * rx + ry * ry
        incidence2 = (nx * rx + ny * ry) ** 2 / r2
        variance = noise_m * noise_m * incidence2 + lines[i, 4] * (1.0 + 1.0 / lines[i, 5]) + 1e-6
        u2 = d * d / variance / (cutoff * cutoff)
        robust = (1.0 - u2) ** 2 if u2 < 1.0 else 0.0
        w = robust / variance
        jt = -nx * ry + ny * rx
        H[0, 0] += w * nx * nx
        H[0, 1] += w * nx * ny
        H[0, 2] += w * nx * jt
        H[1, 1] += w * ny * ny
        H[1, 2] += w * ny * jt
        H[2, 2] += w * jt * jt
        b[0] -= w * nx * d
        b[1] -= w * ny * d
        b[2] -= w * jt * d
        total += w * d * d
        weights += robust
        count += 1.0
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    return np.array([total, weights, count])


@nb.njit(cache=True, nogil=True)
def solve3(A: FloatArray, b: FloatArray) -> FloatArray:
    """Solve a symmetric positive definite 3 x 3 system by Cholesky; zeros where it is singular."""
    x = np.zeros(3)
    l00 = math.sqrt(max(A[0, 0], 1e-300))
    l10, l20 = A[1, 0] / l00, A[2, 0] / l00
    d1 = A[1, 1] - l10 * l10
    if d1 <= 0.0:
        return x
    l11 = math.sqrt(d1)
    l21 = (A[2, 1] - l20 * l10) / l11
    d2 = A[2, 2] - l20 * l20 - l21 * l21
    if d2 <= 0.0:
        return x
    l22 = math.sqrt(d2)
    y0 = b[0] / l00
    y1 = (b[1] - l10 * y0) / l11
    y2 = (b[2] - l20 * y0 - l21 * y1) / l22
    x[2] = y2 / l22
    x[1] = (y1 - l21 * x[2]) / l11
    x[0] = (y0 - l10 * x[1] - l20 * x[2]) / l00
    return x


@nb.njit(cache=True, nogil=True)
def match(map_, points, spacing, predicted, prior_information, noise_m, cutoff, rounds):  # type: ignore[no-untyped-def]
    """Return pose, H (3, 3) of the scan alone, and (square sum, robust weights, lines, points)."""
    pose = predicted.copy()
    lines = np.zeros((points.shape[0], 7))
    H = np.zeros((3, 3))
    b = np.zeros(3)
    found = 0
    stats = np.zeros(3)
    for round_ in range(rounds):
        found = lines_at(map_, pose, points, spacing, lines)
        moved = 0.0
        for _ in range(3):
            stats = normal_equations(pose, points, lines, noise_m, cutoff, H, b)
            error = predicted - pose
            step = solve3(H + prior_information, b + prior_information @ error)
            pose += step
            moved += abs(step[0]) + abs(step[1]) + 5.0 * abs(step[2])
            if abs(step[0]) + abs(step[1]) + 5.0 * abs(step[2]) < 2e-5:
                break
        if moved < 2e-3:
            break
    stats = normal_equations(pose, points, lines, noise_m, cutoff, H, b)
    return pose, H, stats, found
