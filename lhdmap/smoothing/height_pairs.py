"""Kernels of the realignment: walls of one scan as lines, hits of other scans at the same height, the equations of both poses."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

Indices = npt.NDArray[np.int64]

CELL_M = 0.2  # of the grid that hits are looked up in; a pair is never farther apart
_NEIGHBOURS, _NEIGHBOURHOOD_M = 3, 0.25
_APART_SIGMA_M, _HEIGHT_SIGMA_M = 0.1, 0.02
_FARTHEST = (
    4.0  # of the squared distance in those two units: hits farther apart in height see another curve of a rough wall
)
_LEAN = 0.5  # rock a centimetre higher stands so many centimetres in or out
_CUTOFF_SIGMAS, _LEAST_SIGMA_M = 6.0, 0.02
LINE = 6


@nb.njit(cache=True, nogil=True)
def wall_lines(points):  # type: ignore[no-untyped-def]
    """Return the walls at the hits of one scan, points (N, 3) in the order of the beams, where there is one.

    Rows (M, LINE): centre x, y, height (m), normal x, y, scatter across it (m²).
    """
    out, count = np.empty((points.shape[0], LINE)), 0
    for i in range(points.shape[0]):
        n = mx = my = xx = xy = yy = 0.0
        for k in range(max(i - _NEIGHBOURS, 0), min(i + _NEIGHBOURS + 1, points.shape[0])):
            dx, dy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
            if dx * dx + dy * dy < _NEIGHBOURHOOD_M * _NEIGHBOURHOOD_M:
                n, mx, my = n + 1.0, mx + dx, my + dy
                xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        if n < 3.0:
            continue
        mx, my = mx / n, my / n
        xx, xy, yy = xx / n - mx * mx, xy / n - mx * my, yy / n - my * my
        half, difference = 0.5 * (xx + yy), 0.5 * (xx - yy)
        root = math.sqrt(difference * difference + xy * xy)
        small, large = max(half - root, 0.0), half + root
        if large < 4e-4 or small > 0.3 * large:
            continue
        row, cos2 = out[count], difference / root
        row[0], row[1], row[2] = points[i, 0] + mx, points[i, 1] + my, points[i, 2]
        row[3] = -math.copysign(math.sqrt(max(0.5 * (1.0 - cos2), 0.0)), xy)  # half-angle formulas
        row[4], row[5] = math.sqrt(max(0.5 * (1.0 + cos2), 0.0)), small
        count += 1
    return out[:count].copy()


@nb.njit(cache=True, nogil=True)
def _into_cells(x, y, shape):  # type: ignore[no-untyped-def]
    """Return the points by cell, and where each cell's begin; x and y count from the grid's corner."""
    cells, starts = np.empty(x.size, np.int64), np.zeros(shape[0] * shape[1] + 1, np.int64)
    for i in range(x.size):
        cells[i] = int(x[i] / CELL_M) * shape[1] + int(y[i] / CELL_M)
        starts[cells[i] + 1] += 1
    for k in range(starts.size - 1):
        starts[k + 1] += starts[k]
    order, filled = np.empty(x.size, np.int64), starts.copy()
    for i in range(x.size):
        order[filled[cells[i]]] = i
        filled[cells[i]] += 1
    return order, starts


@nb.njit(cache=True, nogil=True)
def _placed(points, owners, poses):  # type: ignore[no-untyped-def]
    """Return x and y of the rows of points (N, 2+) of several scans in the common frame; `owners` (N,): row of `poses` (K, 3)."""
    x, y, at, c, s = np.empty(points.shape[0]), np.empty(points.shape[0]), -1, 1.0, 0.0
    for i in range(points.shape[0]):
        if owners[i] != at:
            at = owners[i]
            c, s = math.cos(poses[at, 2]), math.sin(poses[at, 2])
        x[i] = poses[at, 0] + c * points[i, 0] - s * points[i, 1]
        y[i] = poses[at, 1] + s * points[i, 0] + c * points[i, 1]
    return x, y


@nb.njit(cache=True, nogil=True)
def same_height(lines, wall_owner, hits, hit_owner, poses, travelled, apart_m):  # type: ignore[no-untyped-def]
    """Return for each hit (M,) the wall that it saw again, -1 where there is none.

    `lines` (N, LINE) and `hits` (M, 3) in the frames of their scans, given as rows of `poses` (K, 3); `travelled` (K,): how far
    the machine had driven by then. Scans nearer to each other than `apart_m` are not compared.
    """
    found = np.full(hits.shape[0], -1, np.int64)
    if not lines.shape[0] or not hits.shape[0]:
        return found
    wall_x, wall_y = _placed(lines, wall_owner, poses)
    x, y = _placed(hits, hit_owner, poses)
    low_x, low_y = wall_x.min(), wall_y.min()
    shape = (int((wall_x.max() - low_x) / CELL_M) + 1, int((wall_y.max() - low_y) / CELL_M) + 1)
    order, starts = _into_cells(wall_x - low_x, wall_y - low_y, shape)
    rows = np.empty((order.size, 4))  # what is compared lies together in memory
    for k, i in enumerate(order):
        rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = wall_x[i], wall_y[i], lines[i, 2], travelled[wall_owner[i]]
    per_m, per_height = 1.0 / _APART_SIGMA_M**2, 1.0 / _HEIGHT_SIGMA_M**2
    for i in range(hits.shape[0]):
        mine, nearest = travelled[hit_owner[i]], _FARTHEST
        cx, cy = int(math.floor((x[i] - low_x) / CELL_M)), int(math.floor((y[i] - low_y) / CELL_M))
        for ix in range(max(cx - 1, 0), min(cx + 2, shape[0])):
            first, last = ix * shape[1] + max(cy - 1, 0), ix * shape[1] + min(cy + 2, shape[1])
            if first >= last:
                continue
            for k in range(starts[first], starts[last]):
                dz = rows[k, 2] - hits[i, 2]
                away = dz * dz * per_height
                if away >= nearest or abs(rows[k, 3] - mine) < apart_m:
                    continue
                away += ((rows[k, 0] - x[i]) ** 2 + (rows[k, 1] - y[i]) ** 2) * per_m
                if away < nearest:
                    nearest, found[i] = away, order[k]
    return found


class Joint(NamedTuple):
    """The joint that rear hits swing about: its x in `base_link` (m), and by how much its encoder is off (rad)."""

    x_m: float
    offset_rad: float


class Pairs(NamedTuple):
    """Hits (M, 3) of scans `owner` (M,), each on the wall `line` (M,); `swings` (M,): seen from behind the joint."""

    hits: FloatArray
    owner: Indices
    line: Indices
    swings: npt.NDArray[np.bool_]


@nb.njit(cache=True, nogil=True)
def add_pairs(lines, wall_owner, pairs, poses, joint, noise_m, H, g):  # type: ignore[no-untyped-def]
    """Add the pairs' equations to H and g of 3K + 1 unknowns: the hit lies on the wall's line.

    Unknown are the poses (K, 3) of both scans and, last, the joint's offset. `lines` (N, LINE) and hits in the frames of their
    scans; Tukey's weights. Returns how many pairs count.
    """
    J, rows, counted = np.empty(7), np.empty(7, np.int64), 0
    rows[6] = H.shape[0] - 1
    for i in range(pairs.owner.size):
        k = pairs.line[i]
        a, b = wall_owner[k], pairs.owner[i]
        ca, sa, cb, sb = math.cos(poses[a, 2]), math.sin(poses[a, 2]), math.cos(poses[b, 2]), math.sin(poses[b, 2])
        nx, ny = ca * lines[k, 3] - sa * lines[k, 4], sa * lines[k, 3] + ca * lines[k, 4]
        wx, wy = ca * lines[k, 0] - sa * lines[k, 1], sa * lines[k, 0] + ca * lines[k, 1]
        x, y, turned_x, turned_y = pairs.hits[i, 0], pairs.hits[i, 1], 0.0, 0.0
        if pairs.swings[i]:
            turned_x, turned_y = -y, x - joint.x_m
            x, y = x + joint.offset_rad * turned_x, y + joint.offset_rad * turned_y
        hx, hy = cb * x - sb * y, sb * x + cb * y
        d = nx * (poses[b, 0] + hx - poses[a, 0] - wx) + ny * (poses[b, 1] + hy - poses[a, 1] - wy)
        dz = pairs.hits[i, 2] - lines[k, 2]
        variance = noise_m * noise_m + lines[k, 5] + (_LEAN * dz) ** 2
        u2 = d * d / (_CUTOFF_SIGMAS**2 * max(variance, _LEAST_SIGMA_M**2))
        if u2 >= 1.0:
            continue
        counted += 1
        w = (1.0 - u2) ** 2 / variance
        J[0], J[1], J[2] = -nx, -ny, nx * wy - ny * wx
        J[3], J[4], J[5] = nx, ny, ny * hx - nx * hy
        J[6] = nx * (cb * turned_x - sb * turned_y) + ny * (sb * turned_x + cb * turned_y)
        for p in range(3):
            rows[p], rows[p + 3] = 3 * a + p, 3 * b + p
        for p in range(7):
            g[rows[p]] -= w * J[p] * d
            for q in range(7):
                H[rows[p], rows[q]] += w * J[p] * J[q]
    return counted


@nb.njit(cache=True, nogil=True)
def add_steps(poses, measured, sigmas, H, g):  # type: ignore[no-untyped-def]
    """Add the odometry's steps between neighbouring scans, (K - 1, 3), with their standard deviations, to H and g."""
    for i in range(measured.shape[0]):
        a, b = poses[i], poses[i + 1]
        c, s = math.cos(a[2]), math.sin(a[2])
        dx, dy = b[0] - a[0], b[1] - a[1]
        off = np.array([c * dx + s * dy, c * dy - s * dx, b[2] - a[2]]) - measured[i]
        off[2] = (off[2] + math.pi) % (2.0 * math.pi) - math.pi
        A = np.array([[-c, -s, c * dy - s * dx], [s, -c, -c * dx - s * dy], [0.0, 0.0, -1.0]])
        B = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        for axis in range(3):
            w = 1.0 / (sigmas[i, axis] * sigmas[i, axis])
            J = np.concatenate((A[axis], B[axis]))
            for p in range(6):
                g[3 * i + p] -= w * J[p] * off[axis]
                for q in range(6):
                    H[3 * i + p, 3 * i + q] += w * J[p] * J[q]
