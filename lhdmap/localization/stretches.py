"""Hits counted along the nodes of a map, and the stretches where most of them are not as in the map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.driven import arc_m
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap

if TYPE_CHECKING:
    from lhdmap.localization.changes import Seen

_BIN_M, _SECTORS = 0.5, 16
_HEIGHT = 2.0  # a metre of height is as far as so many in plan
_MOST_SHARE, _FEWEST_VIEWS, _FEWEST_HITS = 0.5, 5, 8
_LEAST_M, _GAP_BINS = 1.0, 4
_SIDES = ("left", "right")


class WallStretch(NamedTuple):
    """As `changes.Change`, its kind as a number: 1 came, 2 went."""

    kind: int
    node: str
    side: str
    start_m: float
    end_m: float
    length_m: float
    depth_m: float
    at_m: tuple[float, float, float]
    since_ns: int
    until_ns: int
    views: int


class _Bin:
    """What was seen of half a metre of one side: hits of each kind, their sums, views, since when."""

    __slots__ = ("at", "counts", "depth", "last_ns", "since_ns", "views")

    def __init__(self) -> None:
        self.counts, self.views = np.zeros(3), np.zeros(3, np.int64)
        self.at, self.depth = np.zeros((3, 3)), np.zeros(3)
        self.since_ns, self.last_ns = [0, 0, 0], [0, 0, 0]

    def add(self, kind: int, at: FloatArray, depth_m: float, count: int, stamp_ns: int) -> None:
        """Count hits of a kind in one view: sum of their places (3,), sum of depths."""
        self.since_ns[kind] = self.since_ns[kind] if self.views[kind] else stamp_ns
        self.last_ns[kind] = stamp_ns
        self.counts[kind] += count
        self.views[kind] += 1
        self.at[kind] += at
        self.depth[kind] += depth_m

    def changed(self, kind: int) -> bool:
        """Return whether most of what was seen here is of a kind."""
        enough = self.counts[kind] >= _FEWEST_HITS and self.views[kind] >= _FEWEST_VIEWS
        return bool(enough and self.counts[kind] >= _MOST_SHARE * self.counts.sum())


class AlongNode:
    """Bins along the lines of the tunnels, left and right, and around the middles of the intersections."""

    def __init__(self, topology: TopologicalMap) -> None:
        self._topology, self._lookup = topology, Lookup(topology)
        self.bins: dict[tuple[str, int, int], _Bin] = {}
        self._lines = {one.id: _fine(one.line_m) for one in topology.tunnels}
        self._trees = {name: KDTree(line[:, :3] * [1.0, 1.0, _HEIGHT]) for name, line in self._lines.items()}

    def add(self, seen: Seen) -> None:
        """Count the hits of one moment."""
        told = seen.kinds >= 0
        points = np.column_stack([seen.points[told], np.full(int(told.sum()), seen.height_m)])
        keys = self._keys(points)
        kinds, depth = seen.kinds[told].astype(np.int64), seen.depth_m[told]
        order = np.lexsort((kinds, *np.array([(hash(one[0]), one[1], one[2]) for one in keys]).reshape(-1, 3).T))
        first = 0
        for k in range(1, len(order) + 1):
            if k < len(order) and keys[order[k]] == keys[order[first]] and kinds[order[k]] == kinds[order[first]]:
                continue
            rows = order[first:k]
            one = self.bins.setdefault(keys[rows[0]], _Bin())
            one.add(int(kinds[rows[0]]), points[rows].sum(axis=0), float(depth[rows].sum()), len(rows), seen.stamp_ns)
            first = k

    def _keys(self, points: FloatArray) -> list[tuple[str, int, int]]:
        """Return node, side (0 left, 1 right, 2 neither) and bin of points (N, 3)."""
        nodes = self._lookup.nodes_at(points)
        out = [("", 2, 0)] * len(points)
        for node in set(nodes):
            rows = np.flatnonzero(np.array([one == node for one in nodes]))
            if node in self._lines:
                line = self._lines[node]
                near = line[self._trees[node].query(points[rows] * [1.0, 1.0, _HEIGHT])[1]]
                off = points[rows, :2] - near[:, :2]
                right = (near[:, 4] * off[:, 1] - near[:, 5] * off[:, 0] < 0.0).astype(int)
                at = np.floor(near[:, 3] / _BIN_M).astype(int)
                for row, side, number in zip(rows.tolist(), right.tolist(), at.tolist(), strict=True):
                    out[row] = (node, side, number)
            elif node:
                off = points[rows, :2] - self._topology.nodes[node].pose_map_node[:2]
                sectors = np.floor(_SECTORS * (np.arctan2(off[:, 1], off[:, 0]) / (2.0 * math.pi) % 1.0)).astype(int)
                for row, number in zip(rows.tolist(), sectors.tolist(), strict=True):
                    out[row] = (node, 2, number)
        return out


def stretches(along: AlongNode) -> list[WallStretch]:
    """Return the changed stretches: bins of one node, side and kind that follow each other, a metre and more."""
    found = []
    for kind in (1, 2):
        changed: dict[tuple[str, int], list[int]] = {}
        for (node, side, number), one in along.bins.items():
            if node and one.changed(kind):
                changed.setdefault((node, side), []).append(number)
        for (node, side), numbers in sorted(changed.items()):
            ordered = np.array(sorted(numbers))
            for group in np.split(ordered, np.flatnonzero(np.diff(ordered) > _GAP_BINS) + 1):
                stretch = _stretch(along, kind, node, side, group)
                if stretch.length_m >= _LEAST_M:
                    found.append(stretch)
    return found


def _stretch(along: AlongNode, kind: int, node: str, side: int, group: npt.NDArray[np.int64]) -> WallStretch:
    own = [along.bins[node, side, number] for number in group.tolist()]
    count = sum(one.counts[kind] for one in own)
    middle = sum((one.at[kind] for one in own), np.zeros(3)) / count
    in_tunnel = side < 2
    start, end = (group[0] * _BIN_M, (group[-1] + 1) * _BIN_M) if in_tunnel else (math.nan, math.nan)
    places = np.array([one.at[kind] / one.counts[kind] for one in own])
    wide = float(np.linalg.norm(np.ptp(places[:, :2], axis=0)))
    return WallStretch(
        kind,
        node,
        _SIDES[side] if in_tunnel else "",
        float(start),
        float(end),
        float(end - start) if in_tunnel else wide,
        float(sum(one.depth[kind] for one in own) / count),
        (float(middle[0]), float(middle[1]), float(middle[2])),
        min(one.since_ns[kind] for one in own),
        max(one.last_ns[kind] for one in own),
        int(max(one.views[kind] for one in own)),
    )


def _fine(line_m: FloatArray) -> FloatArray:
    """Return a line (M, 6) each quarter metre: x, y, z, distance along it, direction."""
    along = arc_m(line_m)
    at = np.arange(0.0, along[-1] + 0.125, 0.25)
    points = np.column_stack([np.interp(at, along, column) for column in line_m.T])
    way = np.gradient(points[:, :2], axis=0) if len(points) > 1 else np.array([[1.0, 0.0]])
    unit = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    return np.column_stack([points, at, unit])
