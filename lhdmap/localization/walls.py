"""The map's walls around a place: the fused walls of all nodes near by, in one piece, so that a hand-over needs none."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.quality import UNMEASURED, Quality
from lhdmap.landmarks.surface import Cells
from lhdmap.landmarks.surface import surface_map as walls_of
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.surface_map import SurfaceMap
from lhdmap.topology.model import TopologicalMap

_REACH_M, _STAYS_M = 45.0, 15.0
_LEVEL_M = 4.0  # nodes farther above or below are another level
_MOST_HITS = 4  # of a cell that are put in: more make a line no surer, and loading slower


class MapWalls:
    """Loads what is near and keeps it until the machine has moved on."""

    def __init__(self, topology: TopologicalMap, landmarks: Landmarks) -> None:
        self._landmarks = landmarks
        self._cells: dict[str, FloatArray] = {}
        self._heights: dict[str, tuple[float, float]] = {}
        for node in topology.nodes.values():
            surface = landmarks.surfaces.get(node.id)
            if surface is None:
                continue
            frame = node.T_map_node[[0, 1, 3]]
            self._cells[node.id] = se2.transform(frame, surface.cells.points_m.astype(float))
            line = getattr(node, "line_m", None)
            heights = node.T_map_node[2:3] if line is None else line[:, 2]
            self._heights[node.id] = float(heights.min()), float(heights.max())
        self._at: FloatArray | None = None
        self._walls: SurfaceMap | None = None

    def quality(self, node: str) -> Quality:
        """Return how well a node's own scans fit its walls."""
        surface = self._landmarks.surfaces.get(node)
        return UNMEASURED if surface is None else surface.quality

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
            low, high = self._heights[node]
            if not low - _LEVEL_M < place[2] < high + _LEVEL_M:
                continue
            near = (np.abs(points - place[:2]) < _REACH_M).all(axis=1)
            parts.append(points[near] - place[:2])
            counts.append(np.minimum(self._landmarks.surfaces[node].cells.counts[near], _MOST_HITS))
        cell_m = next((surface.cells.cell_m for surface in self._landmarks.surfaces.values()), 0.05)
        cells = Cells(np.concatenate(parts).astype(np.float32), np.concatenate(counts), cell_m)
        return walls_of(cells, np.zeros(2), _REACH_M)
