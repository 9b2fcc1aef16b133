"""The equations of scan to map matching: weighted distances of hits to their lines, summed up, and the solution of three."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.surface_map import BELOW, CENTRE_X, CENTRE_Y, NORMAL_X, NORMAL_Y, SERVED
from lhdmap.scan_matching.wall_lines import line_weight, slanted


@nb.njit(cache=True, nogil=True)
def _eliminate(patch, lean, sums):  # type: ignore[no-untyped-def]
    """Take the unknown lean of a patch of wall out of the sums of the equations, and begin the next patch.

    Its hits are off by lean x (height over the map's hits), alike for all of them: the Schur complement of that one unknown,
    with prior N(0, lean²).
    """
    pivot = 1.0 / (patch[3] + 1.0 / (lean * lean))
    g0, g1, g2, gc = patch[0], patch[1], patch[2], patch[4]
    sums[0] -= g0 * g0 * pivot
    sums[1] -= g0 * g1 * pivot
    sums[2] -= g0 * g2 * pivot
    sums[3] -= g1 * g1 * pivot
    sums[4] -= g1 * g2 * pivot
    sums[5] -= g2 * g2 * pivot
    sums[6] += g0 * gc * pivot
    sums[7] += g1 * gc * pivot
    sums[8] += g2 * gc * pivot
    patch[:] = 0.0


@nb.njit(cache=True, nogil=True, inline="always")
def _add(sums, w, nx, ny, jt, d):  # type: ignore[no-untyped-def]
    """Add one equation n · shift + jt turn = -d to the sums: upper triangle of H, then b."""
    wx, wy, wt = w * nx, w * ny, w * jt
    sums[0] += wx * nx
    sums[1] += wx * ny
    sums[2] += wx * jt
    sums[3] += wy * ny
    sums[4] += wy * jt
    sums[5] += wt * jt
    sums[6] -= wx * d
    sums[7] -= wy * d
    sums[8] -= wt * d


@nb.njit(cache=True, nogil=True)
def normal_equations(pose, hits, lines, fine_m, model, H, b):  # type: ignore[no-untyped-def]
    """Fill H (3, 3) and b (3,) of the weighted distances at `pose`; both in the map's axes about the machine.

    Returns (weighted square sum, sum of robust weights) of the front scanner's hits.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    points, sums, patch = hits.points, np.zeros(9), np.zeros(5)
    leaning = hits.layered and model.lean > 0.0
    patch_x = patch_y = math.inf
    total = weights = 0.0
    for i in range(points.shape[0]):
        if lines[i, SERVED] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, NORMAL_X], lines[i, NORMAL_Y]
        towards = nx * rx + ny * ry
        if towards < 0.0:  # one sign for all normals: a lean moves a patch as a whole
            nx, ny = -nx, -ny
        d = nx * (pose[0] + rx - lines[i, CENTRE_X]) + ny * (pose[1] + ry - lines[i, CENTRE_Y])
        d += slanted(hits, i, lines[i], c, s, nx, ny)
        robust, w = line_weight(lines[i], d * d, towards * towards / (rx * rx + ry * ry + 1e-12), fine_m, model)
        if w == 0.0:
            continue
        jt = -nx * ry + ny * rx
        _add(sums, w, nx, ny, jt, d)
        if i < hits.front:
            total += w * d * d
            weights += robust
        if leaning:
            if (rx - patch_x) ** 2 + (ry - patch_y) ** 2 > model.lean_patch_m**2:
                _eliminate(patch, model.lean, sums)
                patch_x, patch_y = rx, ry
            lag = w * lines[i, BELOW]
            patch[0] += lag * nx
            patch[1] += lag * ny
            patch[2] += lag * jt
            patch[3] += lag * lines[i, BELOW]
            patch[4] += lag * d
    if leaning:
        _eliminate(patch, model.lean, sums)
    H[0, 0], H[0, 1], H[0, 2] = sums[0], sums[1], sums[2]
    H[1, 0], H[1, 1], H[1, 2] = sums[1], sums[3], sums[4]
    H[2, 0], H[2, 1], H[2, 2] = sums[2], sums[4], sums[5]
    b[:] = sums[6:9]
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
