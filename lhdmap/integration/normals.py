"""Normals and curvature of a cloud by principal components within a radius (paper, Fig. 9: 0.75 m).

Curvature is the surface variation l0 / (l0 + l1 + l2) with l0 <= l1 <= l2: 0 on a plane, at most 1/3 in a ball (the
upper bound of 0.4 in Fig. 9 can never act). Neighbours are found by sorting the points by cells of the radius' size:
the three cells above each other in z are one run of the sorted array, so a point looks at nine runs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import Float32Array, FloatArray

Runs = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]


class Normals(NamedTuple):
    """Of N points: `normals` (N, 3) and `curvature` (N,) float32, `neighbours` (N,) int32 without the point itself."""

    normals: Float32Array
    curvature: Float32Array
    neighbours: npt.NDArray[np.int32]


def estimate_normals(
    points_m: Float32Array, radius_m: float, viewpoints_m: Float32Array | None = None, *, min_neighbours: int = 5
) -> Normals:
    """Return normals and curvature from all points within `radius_m`.

    Args:
        points_m: shape (N, 3), metres.
        radius_m: radius of the neighbourhood, metres.
        viewpoints_m: shape (N, 3), where each point was seen from: the normal points there; without it, upwards.
        min_neighbours: with fewer, or where the neighbours lie on a line, normal and curvature are zero.

    Raises:
        InputError: a point is not finite, or the cloud is more than two million radii wide.
    """
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
    if len(points) == 0:
        return Normals(np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))
    keys, strides = _cell_keys(points, radius_m)
    order = np.argsort(keys, kind="stable")
    ordered = np.ascontiguousarray(points[order])
    towards = _directions(points, viewpoints_m)[order]
    found = _normals_kernel(keys[order], strides, ordered, towards, radius_m, min_neighbours)
    back = np.argsort(order, kind="stable")
    return Normals(found[0][back], found[1][back], found[2][back])


def _cell_keys(points: FloatArray, radius_m: float) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return one key a point, shape (N,), with z running fastest, and the key's steps in x and y, shape (2,)."""
    if not np.isfinite(points).all():
        raise InputError("normals: a point of the cloud is not finite; remove such points first")
    cells = np.floor((points - points.min(axis=0)) / radius_m)
    if cells.max() > 2_000_000:
        raise InputError(f"normals: the cloud is {np.ptp(points, axis=0).max():.0f} m wide; a stray point is in it")
    # One empty layer on each side, so that a neighbour's key never belongs to another row.
    index = cells.astype(np.int64) + 1
    _, ny, nz = (int(size) for size in index.max(axis=0) + 2)
    strides = np.array([ny * nz, nz], dtype=np.int64)
    return (index[:, 0] * ny + index[:, 1]) * nz + index[:, 2], strides


def _directions(points: FloatArray, viewpoints_m: Float32Array | None) -> FloatArray:
    if viewpoints_m is None:
        return np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return np.asarray(viewpoints_m, dtype=np.float64) - points


@nb.njit(cache=True, nogil=True)
def _normals_kernel(
    keys: npt.NDArray[np.int64],
    strides: npt.NDArray[np.int64],
    points: FloatArray,
    towards: FloatArray,
    radius_m: float,
    min_neighbours: int,
) -> tuple[Float32Array, Float32Array, npt.NDArray[np.int32]]:
    n = points.shape[0]
    normals = np.zeros((n, 3), np.float32)
    curvature = np.zeros(n, np.float32)
    neighbours = np.zeros(n, np.int32)
    start = 0
    runs = np.empty((9, 2), np.int64)
    while start < n:
        end = np.searchsorted(keys, keys[start], side="right")
        _find_runs(keys, keys[start], strides, runs)
        for i in range(start, end):
            covariance, neighbours[i] = _covariance(points, i, runs, radius_m * radius_m)
            if neighbours[i] >= min_neighbours:
                curvature[i] = _principal(covariance, towards[i], normals[i])
        start = end
    return normals, curvature, neighbours


@nb.njit(cache=True, nogil=True)
def _find_runs(
    keys: npt.NDArray[np.int64], key: int, strides: npt.NDArray[np.int64], runs: npt.NDArray[np.int64]
) -> None:
    """Write the nine runs [first, last) of points in the 27 cells around `key`."""
    for run in range(9):
        middle = key + (run // 3 - 1) * strides[0] + (run % 3 - 1) * strides[1]
        runs[run, 0] = np.searchsorted(keys, middle - 1, side="left")
        runs[run, 1] = np.searchsorted(keys, middle + 1, side="right")


@nb.njit(cache=True, nogil=True)
def _covariance(points: FloatArray, i: int, runs: npt.NDArray[np.int64], radius2: float) -> tuple[FloatArray, int]:
    """Return the covariance, shape (3, 3), of the points in the radius around point i, and how many others they are."""
    x, y, z = points[i, 0], points[i, 1], points[i, 2]
    n = 0
    sx = sy = sz = xx = xy = xz = yy = yz = zz = 0.0
    for run in range(9):
        for j in range(runs[run, 0], runs[run, 1]):
            dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
            if dx * dx + dy * dy + dz * dz > radius2:
                continue
            n += 1
            sx, sy, sz = sx + dx, sy + dy, sz + dz
            xx, xy, xz = xx + dx * dx, xy + dx * dy, xz + dx * dz
            yy, yz, zz = yy + dy * dy, yz + dy * dz, zz + dz * dz
    C = np.empty((3, 3))
    C[0, 0], C[1, 1], C[2, 2] = xx - sx * sx / n, yy - sy * sy / n, zz - sz * sz / n
    C[0, 1], C[0, 2], C[1, 2] = xy - sx * sy / n, xz - sx * sz / n, yz - sy * sz / n
    return C / n, n - 1


@nb.njit(cache=True, nogil=True)
def _principal(C: FloatArray, towards: FloatArray, normal: Float32Array) -> float:
    """Write the direction of least variance, turned `towards`, to `normal`; return the surface variation."""
    values, vectors = eigen3(C)
    least = 0
    for axis in range(1, 3):
        if values[axis] < values[least]:
            least = axis
    total = values[0] + values[1] + values[2]
    largest = max(values[0], values[1], values[2])
    second = total - largest - values[least]
    if total <= 0.0 or second <= 1e-9 * largest:  # all on one line: no surface
        return 0.0
    sign = 1.0
    if vectors[0, least] * towards[0] + vectors[1, least] * towards[1] + vectors[2, least] * towards[2] < 0.0:
        sign = -1.0
    for axis in range(3):
        normal[axis] = sign * vectors[axis, least]
    return max(values[least], 0.0) / total


@nb.njit(cache=True, nogil=True)
def eigen3(C: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues (3,), in no order, and eigenvectors (columns, (3, 3)) of a symmetric matrix (its upper part).

    By Jacobi's rotations, which are exact to rounding also where the closed form loses digits: flat, round.
    """
    A = C.copy()
    V = np.eye(3)
    for _ in range(12):
        off = abs(A[0, 1]) + abs(A[0, 2]) + abs(A[1, 2])
        if off <= 1e-15 * (abs(A[0, 0]) + abs(A[1, 1]) + abs(A[2, 2])):
            break
        _rotate(A, V, 0, 1)
        _rotate(A, V, 0, 2)
        _rotate(A, V, 1, 2)
    return np.array([A[0, 0], A[1, 1], A[2, 2]]), V


@nb.njit(cache=True, nogil=True)
def _rotate(A: FloatArray, V: FloatArray, p: int, q: int) -> None:
    """Make A[p, q] zero by one rotation; only the upper part of A is used."""
    if A[p, q] == 0.0:
        return
    ratio = (A[q, q] - A[p, p]) / (2.0 * A[p, q])
    t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    A[p, p] -= t * A[p, q]
    A[q, q] += t * A[p, q]
    A[p, q] = 0.0
    r = 3 - p - q
    a, b = (min(p, r), max(p, r)), (min(q, r), max(q, r))
    A[a], A[b] = c * A[a] - s * A[b], s * A[a] + c * A[b]
    for row in range(3):
        V[row, p], V[row, q] = c * V[row, p] - s * V[row, q], s * V[row, p] + c * V[row, q]
