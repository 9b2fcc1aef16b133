"""Scan to map: Gauss-Newton on the distances of scan points to the walls' lines, with the motion's prediction as a prior."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.odometry.surface_map import fit_line


class MatchModel(NamedTuple):
    """How far a hit may be from the wall's line: see `AnchorSettings` and `OdometrySettings` for the units."""

    noise_m: float
    cutoff_sigmas: float
    min_cells: float
    coarse_noise: float
    rounds: int


class Match(NamedTuple):
    """Result: `pose` (3,), `information` (3, 3) of the scan alone in map axes, share of hits with a line, share that agrees."""

    pose: FloatArray
    information: FloatArray
    covered: float
    support: float
    residual_sigmas: float
    lines: FloatArray


@nb.njit(cache=True, nogil=True)
def lines_at(map_, pose, points, layered, min_cells, lines):  # type: ignore[no-untyped-def]
    """Fit the wall's line at each scan point; return how many have one.

    `points` (N, 3) in the level base frame, heights absolute; `lines` (N, 7): as `fit_line`, then the cell size of the
    level that served (0: none).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    found = 0
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        lines[i, 6] = 0.0
        if fit_line(map_.fine, x, y, points[i, 2], layered, min_cells, lines[i]):
            lines[i, 6] = map_.fine.cell_m
        elif fit_line(map_.middle, x, y, points[i, 2], layered, min_cells, lines[i]):
            lines[i, 6] = map_.middle.cell_m
        elif fit_line(map_.coarse, x, y, points[i, 2], layered, min_cells, lines[i]):
            lines[i, 6] = map_.coarse.cell_m
        found += lines[i, 6] > 0.0
    return found


@nb.njit(cache=True, nogil=True)
def normal_equations(pose, points, lines, fine_m, model, H, b):  # type: ignore[no-untyped-def]
    """Fill H (3, 3) and b (3,) of the weighted distances at `pose`; both in the map's axes about the machine.

    Returns (weighted square sum, sum of robust weights).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    h00 = h01 = h02 = h11 = h12 = h22 = b0 = b1 = b2 = total = weights = 0.0
    for i in range(points.shape[0]):
        if lines[i, 6] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, 2], lines[i, 3]
        d = nx * (pose[0] + rx - lines[i, 0]) + ny * (pose[1] + ry - lines[i, 1])
        incidence2 = (nx * rx + ny * ry) ** 2 / (rx * rx + ry * ry + 1e-12)
        coarse_m = model.coarse_noise * (lines[i, 6] - fine_m)
        variance = model.noise_m**2 * incidence2 + lines[i, 4] * (1.0 + 1.0 / lines[i, 5]) + coarse_m * coarse_m + 1e-6
        u2 = d * d / (variance * model.cutoff_sigmas**2)
        if u2 >= 1.0:
            continue
        robust = (1.0 - u2) ** 2
        w = robust / variance
        jt = -nx * ry + ny * rx
        h00 += w * nx * nx
        h01 += w * nx * ny
        h02 += w * nx * jt
        h11 += w * ny * ny
        h12 += w * ny * jt
        h22 += w * jt * jt
        b0 -= w * nx * d
        b1 -= w * ny * d
        b2 -= w * jt * d
        total += w * d * d
        weights += robust
    H[0, 0], H[0, 1], H[0, 2] = h00, h01, h02
    H[1, 0], H[1, 1], H[1, 2] = h01, h11, h12
    H[2, 0], H[2, 1], H[2, 2] = h02, h12, h22
    b[0], b[1], b[2] = b0, b1, b2
    return total, weights


@nb.njit(cache=True, nogil=True)
def solve3(A: FloatArray, b: FloatArray) -> FloatArray:
    """Solve a symmetric positive definite 3 x 3 system by Cholesky; zeros where it is singular."""
    x = np.zeros(3)
    if not A[0, 0] > 0.0:
        return x
    l00 = math.sqrt(A[0, 0])
    l10, l20 = A[1, 0] / l00, A[2, 0] / l00
    d1 = A[1, 1] - l10 * l10
    if not d1 > 0.0:
        return x
    l11 = math.sqrt(d1)
    l21 = (A[2, 1] - l20 * l10) / l11
    d2 = A[2, 2] - l20 * l20 - l21 * l21
    if not d2 > 0.0:
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
def match(map_, points, layered, predicted, prior_information, start, model):  # type: ignore[no-untyped-def]
    """Return the `Match` of `points` (N, 3), level base frame with absolute heights: maximum a posteriori from `start`.

    `layered`: the scanner tilts, heights matter. The prior has mean `predicted` (3,) and weight `prior_information`
    (3, 3); lines are fitted anew when the pose has moved.
    """
    pose = start.copy()
    lines = np.zeros((points.shape[0], 7))
    H, b = np.zeros((3, 3)), np.zeros(3)
    fine_m = map_.fine.cell_m
    found = 0
    for _ in range(model.rounds):
        found = lines_at(map_, pose, points, layered, model.min_cells, lines)
        moved = 0.0
        for _ in range(3):
            normal_equations(pose, points, lines, fine_m, model, H, b)
            step = solve3(H + prior_information, b + prior_information @ (predicted - pose))
            pose += step
            size = abs(step[0]) + abs(step[1]) + 5.0 * abs(step[2])
            moved += size
            if size < 2e-5:
                break
        if moved < 2e-3:
            break
    total, weights = normal_equations(pose, points, lines, fine_m, model, H, b)
    n = max(points.shape[0], 1)
    return Match(pose, H, found / n, weights / n, math.sqrt(total / max(weights, 1e-9)), lines)
