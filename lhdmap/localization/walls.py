"""The map's walls around a place: the fused walls of all nodes near by, in one piece, so that a hand-over needs none."""

from __future__ import annotations

import math

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
_LEVEL_M = 4.0  # walls farther above or below are another level's, or another winding's of the same tunnel
_MOST_HITS = 4  # of a cell that are put in: more make a line no surer, and loading slower


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
            places = se2.transform(node.T_map_node[[0, 1, 3]], surface.cells.points_m.astype(float))
            heights = surface.cells.heights_m
            by_plan = _heights_by_plan(places, node) if heights is None else heights.astype(float)
            self._cells[node.id] = np.column_stack([places, by_plan])
        self._at: FloatArray | None = None
        self._walls: SurfaceMap | None = None

    def quality(self, node: str) -> Quality:
        """Return how well a node's own scans fit its walls."""
        surface = self._landmarks.surfaces.get(node)
        return UNMEASURED if surface is None else surface.quality

    def cells(self) -> FloatArray:
        """Return all averaged hits (M, 3): x, y in `map`, height of the floor they were seen from."""
        return np.concatenate([np.zeros((0, 3)), *self._cells.values()])

    def around(self, place: FloatArray) -> tuple[SurfaceMap, FloatArray]:
        """Return the walls around a place (3,: x, y, height), and the origin (2,) that their coordinates count from."""
        if self._walls is None or self._at is None or self._is_far(place):
            self._at = place.copy()
            self._walls = self._loaded(place)
        return self._walls, self._at[:2]

    def _is_far(self, place: FloatArray) -> bool:
        assert self._at is not None  # noqa: S101  # asked for after the first load alone
        return math.dist(self._at[:2], place[:2]) > _STAYS_M or abs(self._at[2] - place[2]) > 0.5 * _LEVEL_M

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


def _heights_by_plan(places: FloatArray, node: Tunnel | Intersection) -> FloatArray:
    """Return heights (M,) of places (M, 2) by the node's line, of maps that do not tell them."""
    if isinstance(node, Intersection):
        return np.full(len(places), node.T_map_node[2])
    heights: FloatArray = node.line_m[KDTree(node.line_m[:, :2]).query(places)[1], 2]
    return heights
