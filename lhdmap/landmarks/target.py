"""A cloud that others are placed on: a line at each of its points, and a grid whose cells know the nearest point."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

REACH_M = 0.5
"""Points without another one within this distance have no counterpart."""
CELL_M = 0.05
_NEIGHBOURS, _NEIGHBOURHOOD_M = 8, 0.9
_BEARINGS = 180
_FLATNESS = 0.25  # of PCA: neighbours that scatter more than this across, as a share of along, have no line


class IcpModel(NamedTuple):
    """How clouds are compared: truncation of distances, range of a landmark and centre of it, least share, lines or points."""

    limit_m: float = 0.15
    range_m: float = 10.0
    centre_m: float = 0.0
    min_share: float = 0.6
    to_line: bool = True


class Target(NamedTuple):
    """A cloud (N, 2) that others are placed on, with lines: `anchors` (N, 2), `normals` (N, 2), zero where it has none.

    `nearest` (W, H) int32: index of the point nearest to each cell of `CELL_M`, -1 beyond `REACH_M`; its corner is `origin_m`.
    `seen` (B,): bearings about the centre in which it has a hit.
    """

    points_m: FloatArray
    anchors: FloatArray
    normals: FloatArray
    nearest: npt.NDArray[np.int32]
    origin_m: FloatArray
    seen: npt.NDArray[np.bool_]


@nb.njit(cache=True, nogil=True)
def _lines(points, anchors, normals):  # type: ignore[no-untyped-def]
    """Fill the line at each point: centroid and normal of its nearest neighbours."""
    n = points.shape[0]
    nearest2, index = np.empty(_NEIGHBOURS), np.empty(_NEIGHBOURS, np.int64)
    for i in range(n):
        count = 0
        for j in range(n):
            d2 = (points[j, 0] - points[i, 0]) ** 2 + (points[j, 1] - points[i, 1]) ** 2
            if d2 > _NEIGHBOURHOOD_M**2 or (count == _NEIGHBOURS and d2 >= nearest2[count - 1]):
                continue
            at = min(count, _NEIGHBOURS - 1)
            while at > 0 and nearest2[at - 1] > d2:
                nearest2[at], index[at] = nearest2[at - 1], index[at - 1]
                at -= 1
            nearest2[at], index[at] = d2, j
            count = min(count + 1, _NEIGHBOURS)
        mx = my = 0.0
        for k in range(count):
            mx += points[index[k], 0]
            my += points[index[k], 1]
        mx, my = mx / count, my / count
        xx = xy = yy = 0.0
        for k in range(count):
            dx, dy = points[index[k], 0] - mx, points[index[k], 1] - my
            xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        half, difference = 0.5 * (xx + yy), 0.5 * (xx - yy)
        root = math.sqrt(difference * difference + xy * xy)
        anchors[i, 0], anchors[i, 1] = mx, my
        normals[i, 0] = normals[i, 1] = 0.0
        if count >= 3 and root > 1e-9 and half - root < _FLATNESS * (half + root):
            angle = 0.5 * math.atan2(xy, difference) + 0.5 * math.pi
            normals[i, 0], normals[i, 1] = math.cos(angle), math.sin(angle)


@nb.njit(cache=True, nogil=True)
def prepare(points_m: FloatArray, model: IcpModel) -> Target:
    """Return a cloud (N, 2), metres, N > 0, as a target."""
    n, reach = points_m.shape[0], int(math.ceil(REACH_M / CELL_M))
    anchors, normals = np.empty((n, 2)), np.empty((n, 2))
    _lines(points_m, anchors, normals)
    origin = np.array([points_m[:, 0].min(), points_m[:, 1].min()]) - (reach + 1) * CELL_M
    width = int((points_m[:, 0].max() - origin[0]) / CELL_M) + reach + 2
    height = int((points_m[:, 1].max() - origin[1]) / CELL_M) + reach + 2
    nearest, best = np.full((width, height), -1, np.int32), np.full((width, height), np.float32(REACH_M**2))
    seen = np.zeros(_BEARINGS, np.bool_)
    for i in range(n):
        cx, cy = int((points_m[i, 0] - origin[0]) / CELL_M), int((points_m[i, 1] - origin[1]) / CELL_M)
        for ix in range(cx - reach, cx + reach + 1):
            dx = origin[0] + (ix + 0.5) * CELL_M - points_m[i, 0]
            for iy in range(cy - reach, cy + reach + 1):
                dy = origin[1] + (iy + 0.5) * CELL_M - points_m[i, 1]
                d2 = np.float32(dx * dx + dy * dy)
                if d2 < best[ix, iy]:
                    best[ix, iy], nearest[ix, iy] = d2, i
        seen[bearing(points_m[i, 0] - model.centre_m, points_m[i, 1])] = True
    return Target(points_m, anchors, normals, nearest, origin, seen)


@nb.njit(cache=True, nogil=True, inline="always")
def bearing(x: float, y: float) -> int:
    """Return the index of the bearing of (x, y) in `Target.seen`."""
    return int((math.atan2(y, x) + math.pi) * (_BEARINGS / (2.0 * math.pi))) % _BEARINGS


@nb.njit(cache=True, nogil=True, inline="always")
def counterpart(target, x, y):  # type: ignore[no-untyped-def]
    """Return the index of the target's point nearest to (x, y), -1 where none is in reach."""
    ix, iy = int((x - target.origin_m[0]) / CELL_M), int((y - target.origin_m[1]) / CELL_M)
    if x < target.origin_m[0] or y < target.origin_m[1]:
        return -1
    if ix >= target.nearest.shape[0] or iy >= target.nearest.shape[1]:
        return -1
    return target.nearest[ix, iy]


@nb.njit(cache=True, nogil=True, inline="always")
def distance2(target, k, x, y, to_line):  # type: ignore[no-untyped-def]
    """Return the squared distance (m²) of (x, y) from the line at the target's point `k`, or from it where it has none."""
    nx, ny = target.normals[k, 0], target.normals[k, 1]
    if to_line and (nx != 0.0 or ny != 0.0):
        d = nx * (x - target.anchors[k, 0]) + ny * (y - target.anchors[k, 1])
        return d * d
    return (x - target.points_m[k, 0]) ** 2 + (y - target.points_m[k, 1]) ** 2
