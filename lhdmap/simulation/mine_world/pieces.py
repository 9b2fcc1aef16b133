"""A mine's surface in pieces: each a stretch of a tube, cut by the tubes around it, made when something comes near."""

from __future__ import annotations

import functools
import heapq
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.simulation.drift import Drift
from lhdmap.simulation.mine_world.floor import Floor
from lhdmap.simulation.mine_world.hollow import Skin, Volume, cut, skin_of, without_unused
from lhdmap.simulation.mine_world.tubes import drift_of

PIECE_M = 15.0
_STATION_M = 0.5
_BESIDE_M = 1.5  # walls stand out of their nominal place by less
_BLOCK_M = 8.0  # volumes are made in whole blocks, so that neighbours share them


class Piece(NamedTuple):
    """A stretch of a tube: its rings, the box around it (2, 3), and the stretches (tube, first and last block) that cut it."""

    tube: int
    first: int
    last: int
    box_m: FloatArray
    neighbours: tuple[tuple[int, int, int], ...]


class Pieces:
    """All pieces of a network's surface."""

    def __init__(self, network: Network) -> None:
        self._network, self._floor = network, Floor(network, network.plan.floor, network.plan.seed)
        self.all = _pieces(network)
        self.boxes_m = np.stack([piece.box_m for piece in self.all])
        self._middles = self.boxes_m.mean(axis=1)
        self._adjacent = _adjacent(self.all)
        self._drift = functools.lru_cache(maxsize=None)(self._make_drift)
        self._volume = functools.lru_cache(maxsize=64)(self._make_volume)

    def skin(self, index: int) -> Skin:
        """Return the surface of a piece."""
        piece = self.all[index]
        skin = cut(
            skin_of(self._drift(piece.tube), piece.first, piece.last), [self._volume(*one) for one in piece.neighbours]
        )
        return Skin(without_unused(skin.mesh), skin.floor)

    def within(self, here: Sequence[int], reach_m: float) -> set[int]:
        """Return the pieces that lie within a way through the mine of some of them: rock hides the others."""
        ways = dict.fromkeys(here, 0.0)
        queue = [(0.0, index) for index in here]
        while queue:
            way, index = heapq.heappop(queue)
            if way > ways[index]:
                continue
            for other in self._adjacent[index]:
                further = way + float(np.linalg.norm(self._middles[other] - self._middles[index]))
                if further <= reach_m + PIECE_M and further < ways.get(other, np.inf):
                    ways[other] = further
                    heapq.heappush(queue, (further, other))
        return set(ways)

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height (N,) under points (N, 3); their z says which level."""
        return self._floor.height(points_m)

    def drift(self, tube: int) -> Drift:
        """Return the drift of a tube."""
        return self._drift(tube)

    def _make_drift(self, tube: int) -> Drift:
        return drift_of(self._network, tube, self.floor_height)

    def _make_volume(self, tube: int, first: int, last: int) -> Volume:
        drift, mesh_m = self._drift(tube), self._network.plan.walls.mesh_m
        return Volume(drift, int(first * _BLOCK_M / mesh_m), int(last * _BLOCK_M / mesh_m) + 1, self.floor_height)


def _pieces(network: Network) -> list[Piece]:
    mesh_m = network.plan.walls.mesh_m
    rows = np.concatenate([_stations(network, k) for k in range(len(network.tubes))])
    tree = KDTree(rows[:, :3])
    widest = float(rows[:, 4].max())
    found = []
    for tube, one in enumerate(network.tubes):
        own, count = rows[rows[:, 3] == tube], max(round(one.length_m / PIECE_M), 1)
        ring_count = int(one.length_m / mesh_m) + 1
        edges = np.rint(np.linspace(0, ring_count - 1, count + 1)).astype(int)
        for k in range(count):
            first, last = int(edges[k]), int(edges[k + 1]) + 1
            part = own[(own[:, 5] >= first * mesh_m - _STATION_M) & (own[:, 5] <= last * mesh_m + _STATION_M)]
            reach = float(part[:, 4].max()) + _BESIDE_M
            near = np.unique(np.concatenate(tree.query_ball_point(part[:, :3], reach + widest + _BESIDE_M)).astype(int))
            box = np.stack([part[:, :3].min(axis=0) - reach, part[:, :3].max(axis=0) + reach])
            box[1, 2] += float(one.heights_m[:, 1].max()) - reach + _BESIDE_M
            found.append(Piece(tube, first, last, box, _neighbours(part, rows[near], tube)))
    return found


def _adjacent(pieces: list[Piece]) -> list[list[int]]:
    """Return of each piece those that it opens into: before and behind it, and those that cut it."""
    by_tube: dict[int, list[int]] = {}
    for index, piece in enumerate(pieces):
        by_tube.setdefault(piece.tube, []).append(index)
    found: list[set[int]] = [set() for _ in pieces]
    for index, piece in enumerate(pieces):
        own = by_tube[piece.tube]
        place = own.index(index)
        near = {*own[max(place - 1, 0) : place], *own[place + 1 : place + 2]}
        for tube, _, _ in piece.neighbours:
            near |= {k for k in by_tube[tube] if _boxes_overlap(pieces[k].box_m, piece.box_m)}
        for other in near:
            found[index].add(other)
            found[other].add(index)
    return [sorted(one) for one in found]


def _boxes_overlap(a: FloatArray, b: FloatArray) -> bool:
    return bool(((a[0] < b[1]) & (a[1] > b[0])).all())


def _stations(network: Network, tube: int) -> FloatArray:
    """Return points on a tube's centre line, shape (N, 6): x, y, z, tube, half width, arc length."""
    one = network.tubes[tube]
    s = np.append(np.arange(0.0, one.length_m, _STATION_M), one.length_m)
    half = 0.5 * np.interp(s, *one.widths_m.T)
    return np.column_stack([one.line.at(s)[:, :3], np.full(len(s), float(tube)), half, s])


def _neighbours(part: FloatArray, near: FloatArray, tube: int) -> tuple[tuple[int, int, int], ...]:
    """Return the stretches of other tubes, in blocks, whose walls may reach into a piece with stations `part`."""
    found = []
    for other in np.unique(near[near[:, 3] != tube, 3]):
        rows = near[near[:, 3] == other]
        apart = np.linalg.norm(rows[:, None, :3] - part[None, :, :3], axis=2)
        close = (apart < rows[:, None, 4] + part[None, :, 4] + _BESIDE_M).any(axis=1)
        if close.any():
            low, high = float(rows[close, 5].min()) - 1.0, float(rows[close, 5].max()) + 1.0
            found.append((int(other), max(int(low // _BLOCK_M), 0), int(high // _BLOCK_M) + 1))
    return tuple(found)
