"""One box against one triangle, exact. Both are in the frame of the box: it reaches from -half to half."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

_MOST_CORNERS = 9  # a triangle cut by six planes
_DEPTH_STEP_M = 0.0005


@nb.njit(cache=True, nogil=True)
def point_distance(x: float, y: float, z: float, half: FloatArray) -> float:
    """Return the distance of a point from the box, m."""
    dx, dy, dz = max(abs(x) - half[0], 0.0), max(abs(y) - half[1], 0.0), max(abs(z) - half[2], 0.0)
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@nb.njit(cache=True, nogil=True)
def clipped(corners: FloatArray, half: FloatArray, less_m: float, work: FloatArray) -> int:
    """Cut a triangle (3, 3) by the box less `less_m` all around; `work[0]` becomes its part in there.

    Returns the number of corners of that part, 0 for none. `work` has the shape (2, 10, 3). That a part is left says the same
    as thirteen separating axes.
    """
    count, here = 3, 0
    work[0, :3] = corners
    for axis in range(3):
        size = half[axis] - less_m
        for way in (-1.0, 1.0):
            kept = 0
            for i in range(count):
                j = (i + 1) % count
                over, over_next = way * work[here, i, axis] - size, way * work[here, j, axis] - size
                if over <= 0.0:
                    for k in range(3):
                        work[1 - here, kept, k] = work[here, i, k]
                    kept += 1
                if (over < 0.0 < over_next) or (over_next < 0.0 < over):
                    share = over / (over - over_next)
                    for k in range(3):
                        work[1 - here, kept, k] = work[here, i, k] + share * (work[here, j, k] - work[here, i, k])
                    kept += 1
            count, here = kept, 1 - here
            if count == 0:
                return 0
    return count  # six cuts: it is in work[0] again


@nb.njit(cache=True, nogil=True)
def depth_in(corners: FloatArray, half: FloatArray, least_m: float, work: FloatArray, point: FloatArray) -> float:
    """Return how deep a triangle reaches into the box where that is more than `least_m`, m, else -1; `point` becomes where.

    The depth is by how much the box can shrink and still touch: bisection, to half a millimetre.
    """
    low, high = max(least_m, 0.0), min(half[0], half[1], half[2])
    count = clipped(corners, half, low, work)
    if count == 0 or high <= low:
        return -1.0
    _middle(work, count, point)
    while high - low > _DEPTH_STEP_M:
        middle = 0.5 * (low + high)
        count = clipped(corners, half, middle, work)
        if count > 0:
            low = middle
            _middle(work, count, point)
        else:
            high = middle
    return low


@nb.njit(cache=True, nogil=True)
def _middle(work: FloatArray, count: int, point: FloatArray) -> None:
    for k in range(3):
        point[k] = work[0, :count, k].sum() / count


@nb.njit(cache=True, nogil=True)
def triangle_distance(corners: FloatArray, half: FloatArray, best: float, work: FloatArray) -> float:
    """Return the distance of a triangle from the box where it is less than `best`, m, else `best`; 0 where they touch.

    The nearest points are on an edge of the triangle, or inside of it and then at a corner of the box.
    """
    for i in range(3):
        best = min(best, _edge_distance(corners, i, (i + 1) % 3, half))
    if best > 0.0:
        best = _face_distance(corners, half, best, work)
    return best


@nb.njit(cache=True, nogil=True)
def _slope_part(start: float, end: float, share: float, half: float) -> float:
    at = start + share * (end - start)
    return (at - min(max(at, -half), half)) * (end - start)


@nb.njit(cache=True, nogil=True)
def _edge_distance(corners: FloatArray, i: int, j: int, half: FloatArray) -> float:
    """Return the distance of an edge from the box: it is convex along the edge, bisection finds where its slope is nought."""
    ax, ay, az, bx, by, bz = corners[i, 0], corners[i, 1], corners[i, 2], corners[j, 0], corners[j, 1], corners[j, 2]
    low, high = 0.0, 1.0
    for turn in range(18):
        share = 0.0 if turn == 0 else (1.0 if turn == 1 else 0.5 * (low + high))  # most often an end is nearest
        slope = (
            _slope_part(ax, bx, share, half[0])
            + _slope_part(ay, by, share, half[1])
            + _slope_part(az, bz, share, half[2])
        )
        if slope >= 0.0:
            high = share
        else:
            low = share
        if high <= low:
            break
    share = 0.5 * (low + high)
    return point_distance(ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az), half)


@nb.njit(cache=True, nogil=True)
def _face_distance(corners: FloatArray, half: FloatArray, best: float, work: FloatArray) -> float:
    """Return the least of `best` and the distances of the box's corners that are over the triangle; 0 where one is through."""
    a = corners[0]
    u, v = corners[1] - a, corners[2] - a
    nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < 1e-12:
        return best
    nx, ny, nz = nx / length, ny / length, nz / length
    middle = -(a[0] * nx + a[1] * ny + a[2] * nz)  # of the box, over the plane
    if abs(middle) <= abs(nx) * half[0] + abs(ny) * half[1] + abs(nz) * half[2]:
        return 0.0 if clipped(corners, half, 0.0, work) > 0 else best
    way = math.copysign(1.0, middle)
    uu, uv, vv = (u * u).sum(), (u * v).sum(), (v * v).sum()
    for corner in range(8):
        x = half[0] if corner & 1 else -half[0]
        y = half[1] if corner & 2 else -half[1]
        z = half[2] if corner & 4 else -half[2]
        over = way * (x * nx + y * ny + z * nz) + abs(middle)
        if over >= best:
            continue
        px, py, pz = x - a[0], y - a[1], z - a[2]
        pu, pv = px * u[0] + py * u[1] + pz * u[2], px * v[0] + py * v[1] + pz * v[2]
        s, t = vv * pu - uv * pv, uu * pv - uv * pu
        if s >= 0.0 and t >= 0.0 and s + t <= uu * vv - uv * uv:
            best = over
    return best


@nb.njit(cache=True, nogil=True)
def workspace() -> FloatArray:
    """Return room for `clipped`."""
    return np.empty((2, _MOST_CORNERS + 1, 3))
