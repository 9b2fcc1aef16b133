"""Contact of bodies with walls: boxes against triangles, exactly, found by a grid over each piece of the surface."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.vehicle.bodies import Boxes

_CELL_M = 0.5
_FINE_M = 0.03  # distances are taken at points of a triangle this far apart
_KEPT = 256


class Walls(Protocol):
    """What bodies may touch in a box: pieces, each with a key under which it stays the same."""

    def walls(self, box_m: FloatArray) -> Iterable[tuple[int | str, Mesh]]:
        """Yield key and triangles of the pieces that overlap a box (2, 3)."""
        ...


class Touch(NamedTuple):
    """A body that touches something: its name, a point of what it touches (3,) in `map`, and how deep it is in (m)."""

    body: str
    point_m: FloatArray
    depth_m: float


class _Grid(NamedTuple):
    """Triangles (M, 3, 3) and the cells that they lie in: corner (3,), shape, starts and members."""

    corners_m: FloatArray
    low_m: FloatArray
    shape: tuple[int, int, int]
    starts: npt.NDArray[np.int64]
    members: npt.NDArray[np.int64]


class Contact:
    """Finds what the boxes of a machine touch, and how far they are from it."""

    def __init__(self, world: Walls) -> None:
        self._world = world
        self._grids: OrderedDict[int | str, _Grid] = OrderedDict()

    def touching(self, boxes: Boxes) -> list[Touch]:
        """Return the bodies that are in a wall, each with its deepest place."""
        found: dict[str, Touch] = {}
        for grid in self._near(boxes.around_m):
            for k, name in enumerate(boxes.names):
                out = np.zeros(4)
                if _deepest(boxes.middle_m[k], boxes.axes[k], boxes.half_m[k], grid, out):
                    touch = Touch(name, out[:3].copy(), float(out[3]))
                    if name not in found or touch.depth_m > found[name].depth_m:
                        found[name] = touch
        return list(found.values())

    def clearance_m(self, boxes: Boxes, limit_m: float = 1.0) -> float:
        """Return the least distance of any box from any wall, metres, at most `limit_m`; exact to 1 cm."""
        least = limit_m
        around = boxes.around_m + np.array([[-limit_m], [limit_m]])
        for grid in self._near(around):
            for k in range(len(boxes.names)):
                least = _clearance(boxes.middle_m[k], boxes.axes[k], boxes.half_m[k], grid, least)
        return float(least)

    def _near(self, box_m: FloatArray) -> list[_Grid]:
        grids = []
        for key, mesh in self._world.walls(box_m):
            grid = self._grids.get(key)
            if grid is None:
                grid = self._grids[key] = _gridded(mesh)
                if len(self._grids) > _KEPT:
                    self._grids.popitem(last=False)
            self._grids.move_to_end(key)
            grids.append(grid)
        return grids


def _gridded(mesh: Mesh) -> _Grid:
    """Return the triangles of a mesh with the cells that the boxes around them overlap."""
    corners = np.ascontiguousarray(mesh.vertices_m[mesh.triangles])
    low = corners.min(axis=(0, 1)) - 1e-6
    first = np.floor((corners.min(axis=1) - low) / _CELL_M).astype(np.int64)
    last = np.floor((corners.max(axis=1) - low) / _CELL_M).astype(np.int64)
    shape = tuple((last.max(axis=0) + 1).tolist())
    counts = np.prod(last - first + 1, axis=1)
    cells, members = np.empty(int(counts.sum()), np.int64), np.empty(int(counts.sum()), np.int64)
    _list_cells(first, last, np.array(shape), cells, members)
    order = np.argsort(cells, kind="stable")
    starts = np.searchsorted(cells[order], np.arange(int(np.prod(shape)) + 1)).astype(np.int64)
    return _Grid(corners, low, (shape[0], shape[1], shape[2]), starts, members[order])


@nb.njit(cache=True, nogil=True)
def _list_cells(first, last, shape, cells, members):  # type: ignore[no-untyped-def]
    n = 0
    for m in range(first.shape[0]):
        for i in range(first[m, 0], last[m, 0] + 1):
            for j in range(first[m, 1], last[m, 1] + 1):
                for k in range(first[m, 2], last[m, 2] + 1):
                    cells[n] = (i * shape[1] + j) * shape[2] + k
                    members[n] = m
                    n += 1


@nb.njit(cache=True, nogil=True)
def _cells_of(middle, axes, half, more_m, grid):  # type: ignore[no-untyped-def]
    """First and last cell (6,) that a box, and `more_m` around it, overlaps; last below first for none."""
    _, low, shape, _, _ = grid
    out = np.empty(6, dtype=np.int64)
    for a in range(3):
        reach = more_m
        for b in range(3):
            reach += abs(axes[b, a]) * half[b]
        out[a] = max(int(math.floor((middle[a] - reach - low[a]) / _CELL_M)), 0)
        out[3 + a] = min(int(math.floor((middle[a] + reach - low[a]) / _CELL_M)), shape[a] - 1)
    return out


@nb.njit(cache=True, nogil=True)
def _deepest(middle, axes, half, grid, out):  # type: ignore[no-untyped-def]
    """Whether a box is in any triangle; `out` (4,) becomes the place and the depth of the deepest."""
    corners, _, shape, starts, members = grid
    c = _cells_of(middle, axes, half, 0.0, grid)
    local, found = np.empty((3, 3)), False
    for i in range(c[0], c[3] + 1):
        for j in range(c[1], c[4] + 1):
            for k in range(c[2], c[5] + 1):
                cell = (i * shape[1] + j) * shape[2] + k
                for n in range(starts[cell], starts[cell + 1]):
                    _into_box(corners[members[n]], middle, axes, local)
                    depth = _overlap(local, half)
                    if depth > 0.0 and depth > out[3]:
                        found = True
                        out[3] = depth
                        for a in range(3):
                            out[a] = (
                                corners[members[n], 0, a] + corners[members[n], 1, a] + corners[members[n], 2, a]
                            ) / 3.0
    return found


@nb.njit(cache=True, nogil=True)
def _into_box(corners, middle, axes, local):  # type: ignore[no-untyped-def]
    """Write the corners of a triangle in the frame of a box."""
    for q in range(3):
        for b in range(3):
            total = 0.0
            for a in range(3):
                total += axes[b, a] * (corners[q, a] - middle[a])
            local[q, b] = total


@nb.njit(cache=True, nogil=True)
def _overlap(t, half):  # type: ignore[no-untyped-def]
    """How deep a triangle is in a box around the origin, by the separating axes: 0 where one of them parts the two."""
    least = np.inf
    for a in range(3):
        low, high = min(t[0, a], t[1, a], t[2, a]), max(t[0, a], t[1, a], t[2, a])
        if low > half[a] or high < -half[a]:
            return 0.0
        least = min(least, half[a] - low, high + half[a])
    e = np.empty((3, 3))
    for q in range(3):
        for a in range(3):
            e[q, a] = t[(q + 1) % 3, a] - t[q, a]
    nx = e[0, 1] * e[1, 2] - e[0, 2] * e[1, 1]
    ny = e[0, 2] * e[1, 0] - e[0, 0] * e[1, 2]
    nz = e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0]
    if _parted(t, half, nx, ny, nz):
        return 0.0
    for q in range(3):
        x, y, z = e[q, 0], e[q, 1], e[q, 2]
        if _parted(t, half, 0.0, -z, y) or _parted(t, half, z, 0.0, -x) or _parted(t, half, -y, x, 0.0):
            return 0.0
    return max(least, 1e-9)


@nb.njit(cache=True, nogil=True)
def _parted(t, half, x, y, z):  # type: ignore[no-untyped-def]
    """Whether an axis parts a triangle from a box around the origin."""
    reach = abs(x) * half[0] + abs(y) * half[1] + abs(z) * half[2]
    a = x * t[0, 0] + y * t[0, 1] + z * t[0, 2]
    b = x * t[1, 0] + y * t[1, 1] + z * t[1, 2]
    c = x * t[2, 0] + y * t[2, 1] + z * t[2, 2]
    return min(a, b, c) > reach or max(a, b, c) < -reach


@nb.njit(cache=True, nogil=True)
def _clearance(middle, axes, half, grid, least):  # type: ignore[no-untyped-def]
    """The distance of a box from the triangles, where it is less than `least`."""
    corners, _, shape, starts, members = grid
    c = _cells_of(middle, axes, half, least, grid)
    local = np.empty((3, 3))
    for i in range(c[0], c[3] + 1):
        for j in range(c[1], c[4] + 1):
            for k in range(c[2], c[5] + 1):
                cell = (i * shape[1] + j) * shape[2] + k
                for n in range(starts[cell], starts[cell + 1]):
                    _into_box(corners[members[n]], middle, axes, local)
                    least = min(least, _distance(local, half, least))
    return least


@nb.njit(cache=True, nogil=True)
def _distance(t, half, least):  # type: ignore[no-untyped-def]
    """The distance of a triangle from a box around the origin, at points of it that lie close; `least` where it is more."""
    size = 0.0
    for q in range(3):
        r = (q + 1) % 3
        size = max(size, math.sqrt((t[r, 0] - t[q, 0]) ** 2 + (t[r, 1] - t[q, 1]) ** 2 + (t[r, 2] - t[q, 2]) ** 2))
    x, y, z = (
        (t[0, 0] + t[1, 0] + t[2, 0]) / 3.0,
        (t[0, 1] + t[1, 1] + t[2, 1]) / 3.0,
        (t[0, 2] + t[1, 2] + t[2, 2]) / 3.0,
    )
    if _to_box(x, y, z, half) - size > least:
        return least
    if _overlap(t, half) > 0.0:
        return 0.0
    steps = max(int(math.ceil(size / _FINE_M)), 1)
    for i in range(steps + 1):
        for j in range(steps + 1 - i):
            u, v = i / steps, j / steps
            w = 1.0 - u - v
            here = _to_box(
                w * t[0, 0] + u * t[1, 0] + v * t[2, 0],
                w * t[0, 1] + u * t[1, 1] + v * t[2, 1],
                w * t[0, 2] + u * t[1, 2] + v * t[2, 2],
                half,
            )
            least = min(least, here)
    return least


@nb.njit(cache=True, nogil=True)
def _to_box(x, y, z, half):  # type: ignore[no-untyped-def]
    """The distance of a point from a box around the origin; 0 inside."""
    dx, dy, dz = max(abs(x) - half[0], 0.0), max(abs(y) - half[1], 0.0), max(abs(z) - half[2], 0.0)
    return math.sqrt(dx * dx + dy * dy + dz * dz)
