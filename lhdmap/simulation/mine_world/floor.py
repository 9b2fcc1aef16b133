"""One floor for a whole mine: a function of the place alone, so that drifts join without a step, and wheels and rays agree.

The centre lines give the height, blended where drifts overlap; waves and stones are random functions of x and y.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.plan import FloorPlan

_STATION_M = 0.25
_CELL_M = 4.0
_BEYOND_M = 1.0  # a drift's floor counts so far beyond its wall
_OTHER_LEVEL_M = 2.6  # stations this far above or below a point are another level's
_MOST = 12  # drifts that overlap at one place, at most
_BLOCK, _TOLERANCE_M = 8, 1e-6  # stations that are passed over at once
_MEAN_SQUARE = 151.0 / 315.0  # of a sum of cubic B-splines with independent unit coefficients, per dimension

# Knot spacing (m), as in the drift scenario: what a machine of 3.4 m wheelbase rides up and down, and stones.
_WAVES = (4.0, 2.0, 1.0)
_STONES = (0.4, 0.2, 0.1)
_GAINS = (0.6, 0.7)


class Stations(NamedTuple):
    """Points of all centre lines, `rows` (N, 7): x, y, z, x and y of the direction, half width, tube; and a grid to find them.

    `starts` (columns · rows + 1,) lists the blocks of each cell, `blocks` (B + 1,) the `members` of each block: a few stations of
    one tube. `places` (N, 3): of the members; `rounds` (B, 4): a circle around each block and its tube (x, y, radius, tube).
    `corner_m` (2,) is the grid's.
    """

    rows: FloatArray
    corner_m: FloatArray
    shape: tuple[int, int]
    starts: npt.NDArray[np.int64]
    blocks: npt.NDArray[np.int64]
    members: npt.NDArray[np.int64]
    places: FloatArray
    rounds: FloatArray
    cell_m: float


class Floor:
    """The floor of a network."""

    def __init__(self, network: Network, settings: FloorPlan, seed: int) -> None:
        self._stations = _stations(network)
        self._octaves = _octaves(settings)
        self._seed = np.uint64(seed * 2 + 1)

    def height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height (N,) under points (N, 3); their z says which level."""
        points = np.ascontiguousarray(points_m, dtype=float)
        out = np.empty(len(points))
        _heights(points, self._stations, self._octaves, self._seed, out)
        return out


def _octaves(settings: FloorPlan) -> FloatArray:
    """Return knot spacing and amplitude of each scale, shape (6, 2)."""
    rows = []
    for spacings, gain, rms_m in zip(
        (_WAVES, _STONES), _GAINS, (settings.undulation_m, settings.roughness_m), strict=True
    ):
        amplitudes = gain ** np.arange(len(spacings))
        amplitudes *= rms_m / math.sqrt(float(np.sum(amplitudes**2)))
        rows += list(zip(spacings, amplitudes / _MEAN_SQUARE, strict=True))
    return np.array(rows)


def _stations(network: Network) -> Stations:
    parts = []
    for index, tube in enumerate(network.tubes):
        s = np.append(np.arange(0.0, tube.length_m - 0.5 * _STATION_M, _STATION_M), tube.length_m)
        pose = tube.line.at(s)
        half = 0.5 * np.interp(s, *tube.widths_m.T)
        parts.append(
            np.stack(
                [*pose[:, :3].T, np.cos(pose[:, 3]), np.sin(pose[:, 3]), half, np.full(len(s), float(index))], axis=1
            )
        )
    rows = np.concatenate(parts)
    cell_m = max(_CELL_M, float(rows[:, 5].max()) + _BEYOND_M)
    corner = rows[:, :2].min(axis=0) - cell_m
    cells = np.floor((rows[:, :2] - corner) / cell_m).astype(np.int64)
    shape = tuple((cells.max(axis=0) + 2).tolist())
    flat = cells[:, 0] * shape[1] + cells[:, 1]
    order = np.lexsort((np.arange(len(rows)), rows[:, 6], flat))
    ends = _block_ends(flat[order], rows[order, 6])
    starts = np.searchsorted(flat[order][ends[:-1]], np.arange(shape[0] * shape[1] + 1))
    places = np.ascontiguousarray(rows[order, :3])
    rounds = np.array([_round(places[a:b], rows[order[a], 6]) for a, b in pairwise(ends.tolist())])
    members = order.astype(np.int64)
    return Stations(rows, corner, (shape[0], shape[1]), starts.astype(np.int64), ends, members, places, rounds, cell_m)


def _block_ends(cells: npt.NDArray[np.int64], tubes: FloatArray) -> npt.NDArray[np.int64]:
    """Return where blocks of members begin, and the end of the last: each of one cell and one tube, of a few stations."""
    new = np.flatnonzero((np.diff(cells) != 0) | (np.diff(tubes) != 0)) + 1
    runs = pairwise([0, *new.tolist(), len(cells)])
    return np.array([*(k for a, b in runs for k in range(a, b, _BLOCK)), len(cells)], dtype=np.int64)


def _round(places: FloatArray, tube: float) -> tuple[float, float, float, float]:
    """Return a circle around stations (N, 3): x, y, radius, and their tube."""
    x, y = places[:, :2].mean(axis=0).tolist()
    return x, y, float(np.hypot(places[:, 0] - x, places[:, 1] - y).max()) + _TOLERANCE_M, tube


@nb.njit(cache=True, nogil=True)
def _heights(points, stations, octaves, seed, out):  # type: ignore[no-untyped-def]
    for k in range(points.shape[0]):
        x, y, z = points[k]
        out[k] = _line_height(x, y, z, stations) + _noise(x, y, octaves, seed)


@nb.njit(cache=True, nogil=True)
def _line_height(x, y, z, stations):  # type: ignore[no-untyped-def]
    """Height of the centre lines at a place: those whose drift it is in, blended by how far it is inside."""
    rows = stations[0]
    best, station = np.full(_MOST, np.inf), np.zeros(_MOST, dtype=np.int64)
    total, weight, nearest, fallback = 0.0, 0.0, np.inf, z
    for q in range(_nearest_of_each(x, y, z, stations, best, station)):
        here, apart = _on_line(x, y, station[q], rows)
        half = rows[station[q], 5]
        w = max(0.0, 1.0 - apart / (half + _BEYOND_M)) ** 2
        total += w * here
        weight += w
        if apart / half < nearest:
            nearest, fallback = apart / half, here
    return total / weight if weight > 1e-6 else fallback


@nb.njit(cache=True, nogil=True)
def _nearest_of_each(x, y, z, stations, best, station):  # type: ignore[no-untyped-def]
    """Write the nearest station of each tube near a place, and its squared distance; return how many tubes there are."""
    _, corner, shape, starts, blocks, members, places, rounds, cell_m = stations
    ci, cj = int(math.floor((x - corner[0]) / cell_m)), int(math.floor((y - corner[1]) / cell_m))
    tubes = np.empty(_MOST)
    count = 0
    for i in range(max(ci - 1, 0), min(ci + 2, shape[0])):
        for j in range(max(cj - 1, 0), min(cj + 2, shape[1])):
            for k in range(starts[i * shape[1] + j], starts[i * shape[1] + j + 1]):
                q = 0
                while q < count and tubes[q] != rounds[k, 3]:
                    q += 1
                if q == _MOST or (q < count and _beyond(x, y, rounds[k], best[q])):
                    continue
                if _nearest_of_block(x, y, z, blocks[k], blocks[k + 1], places, best, station, q) and q == count:
                    tubes[q] = rounds[k, 3]
                    count += 1
    for q in range(count):
        station[q] = members[station[q]]
    return count


@nb.njit(cache=True, nogil=True)
def _beyond(x, y, circle, square):  # type: ignore[no-untyped-def]
    """Return whether all of a circle is farther away than a squared distance."""
    reach = math.sqrt(square) + circle[2]
    return (circle[0] - x) ** 2 + (circle[1] - y) ** 2 > reach * reach


@nb.njit(cache=True, nogil=True)
def _nearest_of_block(x, y, z, first, end, places, best, station, q):  # type: ignore[no-untyped-def]
    """Keep, as that of tube `q`, the nearest station of a block, if it is nearer; return whether any is on this level."""
    found = False
    for m in range(first, end):
        if abs(places[m, 2] - z) <= _OTHER_LEVEL_M:
            found = True
            square = (places[m, 0] - x) ** 2 + (places[m, 1] - y) ** 2
            if square < best[q]:
                best[q], station[q] = square, m
    return found


@nb.njit(cache=True, nogil=True)
def _on_line(x, y, row, rows):  # type: ignore[no-untyped-def]
    """Height of one centre line beside a point, and how far it is from the line in plan."""
    along = (x - rows[row, 0]) * rows[row, 3] + (y - rows[row, 1]) * rows[row, 4]
    other = row + 1 if along > 0.0 else row - 1
    if other < 0 or other >= rows.shape[0] or rows[other, 6] != rows[row, 6]:
        return rows[row, 2], math.hypot(x - rows[row, 0], y - rows[row, 1])
    dx, dy = rows[other, 0] - rows[row, 0], rows[other, 1] - rows[row, 1]
    share = ((x - rows[row, 0]) * dx + (y - rows[row, 1]) * dy) / (dx * dx + dy * dy)
    share = min(max(share, 0.0), 1.0)
    apart = math.hypot(x - rows[row, 0] - share * dx, y - rows[row, 1] - share * dy)
    return rows[row, 2] + share * (rows[other, 2] - rows[row, 2]), apart


@nb.njit(cache=True, nogil=True)
def _noise(x, y, octaves, seed):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(octaves.shape[0]):
        spacing, amplitude = octaves[k]
        if amplitude == 0.0:
            continue
        u, v = x / spacing, y / spacing
        i, j = int(math.floor(u)), int(math.floor(v))
        wu, wv = _weights(u - i), _weights(v - j)
        value = 0.0
        for a in range(4):
            row = 0.0
            for b in range(4):
                row += wv[b] * _chance(i + a, j + b, k, seed)
            value += wu[a] * row
        total += amplitude * value
    return total


@nb.njit(cache=True, nogil=True)
def _weights(t):  # type: ignore[no-untyped-def]
    return (
        (1.0 - t) ** 3 / 6.0,
        (3.0 * t**3 - 6.0 * t**2 + 4.0) / 6.0,
        (-3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0) / 6.0,
        t**3 / 6.0,
    )


@nb.njit(cache=True, nogil=True)
def _chance(i, j, k, seed):  # type: ignore[no-untyped-def]
    """A number of mean 0 and variance 1 that belongs to a knot (splitmix64 of its indices)."""
    h = np.uint64(i) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(j) * np.uint64(0xC2B2AE3D27D4EB4F)
    h += np.uint64(k) * np.uint64(0x165667B19E3779F9) + seed * np.uint64(0xD6E8FEB86659FD93)
    h ^= h >> np.uint64(30)
    h *= np.uint64(0xBF58476D1CE4E5B9)
    h ^= h >> np.uint64(27)
    h *= np.uint64(0x94D049BB133111EB)
    h ^= h >> np.uint64(31)
    return (float(h >> np.uint64(11)) / 9007199254740992.0 - 0.5) * 3.4641016151377544
