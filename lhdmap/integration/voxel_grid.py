"""A streaming voxel grid: absolute, anisotropic, with hits, centroid, stamps and viewpoint of each voxel.

Absolute: voxel (i, j, k) is always floor(p / size), whatever was added before, so tiles, frames and repeated runs agree
and putting a cloud of centroids in again gives the same cloud. Memory grows with the mapped surface (about 0.13 kB a
voxel), never with the length of the log. Cell size 0.2 x 0.2 x 0.1 m: paper, Fig. 9.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.errors import UsageError
from lhdmap.integration.cloud import GridCloud
from lhdmap.messages import FloatArray

VOXEL = np.dtype(  # 64 bytes: one cache line
    [
        *((name, "<i8") for name in ("key", "first_ns", "last_ns")),
        *((name, "<f8") for name in ("x", "y", "z")),
        *((name, "<f4") for name in ("vx", "vy", "vz")),
        ("hits", "<u4"),
    ]
)
EMPTY = -1
BITS = 21  # of a key for each axis: +-1,048,575 cells, 209 km at 0.2 m
HALF = 1 << (BITS - 1)
MASK = (1 << BITS) - 1
BLOCK = 8192  # points added between two looks at the table's load


Rows = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]  # of each sweep: first row, number of rows


class Table(NamedTuple):
    """Open addressing: `keys` (C,) int64, `slots` (C,) int32 into `voxels` (M,); C is a power of two."""

    keys: npt.NDArray[np.int64]
    slots: npt.NDArray[np.int32]
    voxels: npt.NDArray[np.void]


class VoxelGrid:
    """Collects points into voxels of `size_m`; `add` may be called for ever, `cloud` at any time.

    Deterministic: voxels keep the order in which they were first hit.
    """

    def __init__(self, size_m: tuple[float, float, float] = (0.2, 0.2, 0.1)) -> None:
        if not (len(size_m) == 3 and all(np.isfinite(size_m)) and min(size_m) > 0.0):
            raise UsageError(f"voxel size {size_m}: three lengths above zero were wanted")
        self.size_m = np.array(size_m, dtype=np.float64)
        self.refused = 0
        self._count = 0
        self._table = _empty_table(1 << 13)

    def __len__(self) -> int:
        return self._count

    @property
    def hits(self) -> int:
        """Number of points that the grid holds."""
        return int(self.voxels["hits"].sum(dtype=np.int64))

    @property
    def voxels(self) -> npt.NDArray[np.void]:
        """The voxels in the order of their first hit, dtype `VOXEL`; x y z are sums over the hits. Read only."""
        return self._table.voxels[: self._count]

    def add(self, points_map: FloatArray, stamps_ns: npt.NDArray[np.int64], viewpoint_map: FloatArray) -> int:
        """Add points, shape (N, 3), metres, measured at `stamps_ns`, shape (N,), from `viewpoint_map`, shape (3,).

        Returns how many were refused: not finite, or more than a million cells from the origin.
        """
        points = np.ascontiguousarray(points_map, dtype=np.float64)
        stamps = np.ascontiguousarray(stamps_ns, dtype=np.int64)
        viewpoints = np.ascontiguousarray(viewpoint_map, dtype=np.float64).reshape(1, 3)
        refused = 0
        for start in range(0, len(points), BLOCK):
            rows = np.array([start]), np.array([min(BLOCK, len(points) - start)])
            refused += self.add_sweeps(points, stamps, rows, viewpoints)
        return refused

    def add_sweeps(
        self, points_map: FloatArray, stamps_ns: npt.NDArray[np.int64], rows: Rows, viewpoints_map: FloatArray
    ) -> int:
        """Add the points of S sweeps, each a run of rows of the arrays (P, 3) and (P,), seen from viewpoints (S, 3).

        Returns how many points were refused, as `add`.
        """
        self._make_room(int(rows[1].sum()))
        self._count, refused = insert_sweeps(
            self._table, self._count, self.size_m, points_map, stamps_ns, rows, viewpoints_map
        )
        self.refused += refused
        return refused

    def cloud(self, min_hits: int = 1, min_neighbour_hits: int = 0) -> GridCloud:
        """Return the centroids with hits, first stamp and viewpoint, in the order of their first hit.

        A voxel with fewer than `min_hits` hits is left out unless its 26 neighbours hold `min_neighbour_hits` hits
        together: that drops returns from dust and mixed pixels, which are seen once and alone.
        """
        voxels = self.voxels
        if min_hits > 1 and min_neighbour_hits > 0:
            voxels = voxels[supported(self._table, self._count, min_hits, min_neighbour_hits)]
        return GridCloud(
            points_m=centroids(voxels, self.size_m),
            stamps_ns=voxels["first_ns"].copy(),
            hits=voxels["hits"].copy(),
            viewpoints_m=np.stack([voxels["vx"], voxels["vy"], voxels["vz"]], axis=-1),
        )

    def _make_room(self, points: int) -> None:
        """Grow table and voxels so that `points` new voxels fit with the table at most half full."""
        wanted = self._count + points
        table = self._table
        if wanted > len(table.voxels):
            voxels = np.zeros(max(wanted, len(table.voxels) * 3 // 2), dtype=VOXEL)
            voxels[: self._count] = table.voxels[: self._count]
            table = table._replace(voxels=voxels)
        if 2 * wanted > len(table.keys):
            larger = _empty_table(1 << (2 * wanted - 1).bit_length())
            table = larger._replace(voxels=table.voxels)
            fill(table, self._count)
        self._table = table


def _empty_table(capacity: int) -> Table:
    return Table(np.full(capacity, EMPTY, dtype=np.int64), np.zeros(capacity, dtype=np.int32), np.zeros(0, dtype=VOXEL))


@nb.njit(cache=True, nogil=True)
def _home(key: int | np.int64, mask: int) -> np.int64:
    """Return the place in the table where a key belongs: multiplicative (Fibonacci) hashing, high bits folded in."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(mask))


@nb.njit(cache=True, nogil=True)
def _place(table: Table, key: int | np.int64) -> np.int64:
    """Return the place of `key`, or the empty place where it is to go."""
    mask = table.keys.shape[0] - 1
    place = _home(key, mask)
    while table.keys[place] != key and table.keys[place] != EMPTY:
        place = (place + 1) & mask
    return place


@nb.njit(cache=True, nogil=True)
def fill(table: Table, count: int) -> None:
    """Enter the first `count` voxels into an empty table."""
    for slot in range(count):
        place = _place(table, table.voxels[slot].key)
        table.keys[place] = table.voxels[slot].key
        table.slots[place] = slot


@nb.njit(cache=True, nogil=True)
def insert(
    table: Table,
    count: int,
    size_m: FloatArray,
    points: FloatArray,
    stamps_ns: npt.NDArray[np.int64],
    viewpoint: FloatArray,
) -> tuple[int, int]:
    """Add points to the table, which has room for them; return (voxels now, points refused)."""
    refused = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        a, b, c = np.floor(x / size_m[0]), np.floor(y / size_m[1]), np.floor(z / size_m[2])
        if not (abs(a) < HALF and abs(b) < HALF and abs(c) < HALF):  # NaN comes here too
            refused += 1
            continue
        key = ((np.int64(a) + HALF) << (2 * BITS)) | ((np.int64(b) + HALF) << BITS) | (np.int64(c) + HALF)
        place = _place(table, key)
        if table.keys[place] == EMPTY:
            table.keys[place] = key
            table.slots[place] = count
            _open(table.voxels, count, key, stamps_ns[i], viewpoint)
            count += 1
        voxel = table.voxels[table.slots[place]]
        voxel.x += x
        voxel.y += y
        voxel.z += z
        voxel.hits += 1
        voxel.first_ns = min(voxel.first_ns, stamps_ns[i])
        voxel.last_ns = max(voxel.last_ns, stamps_ns[i])
    return count, refused


@nb.njit(cache=True, nogil=True)
def insert_sweeps(
    table: Table,
    count: int,
    size_m: FloatArray,
    points: FloatArray,
    stamps_ns: npt.NDArray[np.int64],
    rows: Rows,
    viewpoints: FloatArray,
) -> tuple[int, int]:
    """Add the points of many sweeps, sweep by sweep, as `insert` does; return (voxels now, points refused)."""
    refused = 0
    for k in range(rows[0].shape[0]):
        first, end = rows[0][k], rows[0][k] + rows[1][k]
        count, bad = insert(table, count, size_m, points[first:end], stamps_ns[first:end], viewpoints[k])
        refused += bad
    return count, refused


@nb.njit(cache=True, nogil=True)
def _open(voxels: npt.NDArray[np.void], slot: int, key: np.int64, stamp_ns: np.int64, viewpoint: FloatArray) -> None:
    voxel = voxels[slot]
    voxel.key = key
    voxel.first_ns = stamp_ns
    voxel.last_ns = stamp_ns
    voxel.x = voxel.y = voxel.z = 0.0
    voxel.vx, voxel.vy, voxel.vz = viewpoint[0], viewpoint[1], viewpoint[2]
    voxel.hits = 0


@nb.njit(cache=True, nogil=True)
def supported(table: Table, count: int, min_hits: int, min_neighbour_hits: int) -> npt.NDArray[np.bool_]:
    """Return which voxels have `min_hits` hits or 26 neighbours with `min_neighbour_hits` together; shape (count,)."""
    keep = np.zeros(count, dtype=np.bool_)
    for slot in range(count):
        key, around = table.voxels[slot].key, 0
        keep[slot] = table.voxels[slot].hits >= min_hits
        if keep[slot]:
            continue
        for step in range(27):
            i, j, k = step // 9 - 1, (step // 3) % 3 - 1, step % 3 - 1
            if step == 13:
                continue
            place = _place(table, key + (i << (2 * BITS)) + (j << BITS) + k)
            if table.keys[place] != EMPTY:
                around += table.voxels[table.slots[place]].hits
        keep[slot] = around >= min_neighbour_hits
    return keep


@nb.njit(cache=True, nogil=True)
def centroids(voxels: npt.NDArray[np.void], size_m: FloatArray) -> npt.NDArray[np.float32]:
    """Return the centroids as float32, shape (N, 3), each inside its own voxel also after rounding."""
    out = np.empty((voxels.shape[0], 3), dtype=np.float32)
    for n in range(voxels.shape[0]):
        voxel = voxels[n]
        sums = (voxel.x, voxel.y, voxel.z)
        for axis in range(3):
            cell = ((voxel.key >> (BITS * (2 - axis))) & MASK) - HALF
            out[n, axis] = _inside(np.float32(sums[axis] / voxel.hits), cell, size_m[axis])
    return out


@nb.njit(cache=True, nogil=True)
def _inside(value: np.float32, cell: int, size_m: float) -> np.float32:
    """Return `value`, moved by single float32 steps into the cell where rounding has put it outside."""
    middle = np.float32((cell + 0.5) * size_m)
    for _ in range(4):
        if np.floor(np.float64(value) / size_m) == cell:
            return value
        value = np.nextafter(value, middle)
    return middle
