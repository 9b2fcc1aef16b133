"""The map's walls around a place: the fused walls of all nodes near by, in one piece, so that a hand-over needs none."""

from __future__ import annotations

import copy
import math
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from scipy.spatial import KDTree

from lhdmap.geometry import se2
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.quality import UNMEASURED, Quality
from lhdmap.landmarks.surface import Cells
from lhdmap.landmarks.surface import surface_map as walls_of
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.surface_map import SurfaceMap
from lhdmap.topology.model import Intersection, TopologicalMap, Tunnel

_REACH_M, _STAYS_M = 45.0, 15.0
_AHEAD_M = 8.0  # from here on the next walls are put together, beside the tracking
_LEVEL_M = 4.0  # walls farther above or below are another level's, or another winding's of the same tunnel
_MOST_HITS = 4  # of a cell that are put in: more make a line no surer, and loading slower

_THREAD = ThreadPoolExecutor(1, "walls")


class MapWalls:
    """Loads what is near and keeps it until the machine has moved on."""

    def __init__(self, topology: TopologicalMap, landmarks: Landmarks) -> None:
        self._landmarks = landmarks
        self._cells: dict[
            str, FloatArray
        ] = {}  # (M, 3) by node: x, y in `map`, height of the floor they were seen from
        for node in topology.nodes.values():
            surface = landmarks.surfaces.get(node.id)
            if surface is None:
                continue
            places = se2.transform(node.pose_map_node[[0, 1, 3]], surface.cells.points_m.astype(float))
            heights = surface.cells.heights_m
            by_plan = _heights_by_plan(places, node) if heights is None else heights.astype(float)
            self._cells[node.id] = np.column_stack([places, by_plan])
        self._at: FloatArray | None = None
        self._walls: SurfaceMap | None = None
        self._coming: tuple[FloatArray, Future[SurfaceMap]] | None = None

    def apart(self) -> MapWalls:
        """Return the same walls for another user, who looks elsewhere."""
        other = copy.copy(self)
        other._at = other._walls = other._coming = None  # noqa: SLF001  # its own class
        return other

    def quality(self, node: str) -> Quality:
        """Return how well a node's own scans fit its walls."""
        surface = self._landmarks.surfaces.get(node)
        return UNMEASURED if surface is None else surface.quality

    def cells(self) -> FloatArray:
        """Return all averaged hits (M, 3): x, y in `map`, height of the floor they were seen from."""
        return np.concatenate([np.zeros((0, 3)), *self._cells.values()])

    def around(self, place: FloatArray) -> tuple[SurfaceMap, FloatArray]:
        """Return the walls around a place (3,: x, y, height), and the origin (2,) that their coordinates count from."""
        if self._walls is None or self._at is None or _is_far(self._at, place, _STAYS_M):
            self._at, self._walls = self._next(place)
        elif self._coming is None and _is_far(self._at, place, _AHEAD_M):
            self._coming = place.copy(), _THREAD.submit(self._loaded, place.copy())
        return self._walls, self._at[:2]

    def _next(self, place: FloatArray) -> tuple[FloatArray, SurfaceMap]:
        """Return the walls that were begun on the way here, where they are of here; which ones is decided by places alone."""
        coming, self._coming = self._coming, None
        if coming is not None and not _is_far(coming[0], place, _STAYS_M):
            return coming[0], coming[1].result()
        return place.copy(), self._loaded(place)

    def _loaded(self, place: FloatArray) -> SurfaceMap:
        parts, counts = [np.zeros((0, 2))], [np.zeros(0, np.uint16)]
        for node, points in self._cells.items():
            near = (np.abs(points[:, :2] - place[:2]) < _REACH_M).all(axis=1)
            near &= np.abs(points[:, 2] - place[2]) < _LEVEL_M
            parts.append(points[near, :2] - place[:2])
            counts.append(np.minimum(self._landmarks.surfaces[node].cells.counts[near], _MOST_HITS))
        cell_m = next((surface.cells.cell_m for surface in self._landmarks.surfaces.values()), 0.05)
        cells = Cells(np.concatenate(parts).astype(np.float32), np.concatenate(counts), cell_m)
        return walls_of(cells, np.zeros(2), _REACH_M)


def _is_far(at: FloatArray, place: FloatArray, far_m: float) -> bool:
    """Return whether a place (3,) is so far from another, or on another level."""
    return math.dist(at[:2], place[:2]) > far_m or abs(at[2] - place[2]) > 0.5 * _LEVEL_M


def _heights_by_plan(places: FloatArray, node: Tunnel | Intersection) -> FloatArray:
    """Return heights (M,) of places (M, 2) by the node's line, of maps that do not tell them."""
    if isinstance(node, Intersection):
        return np.full(len(places), node.pose_map_node[2])
    heights: FloatArray = node.line_m[KDTree(node.line_m[:, :2]).query(places)[1], 2]
    return heights
