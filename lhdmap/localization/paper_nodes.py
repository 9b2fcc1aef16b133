"""The nodes of a map as the paper's localization needs them: a tunnel's axis, and landmarks prepared to be matched with."""

from __future__ import annotations

import functools
import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.icp import IcpFit, align, best_of
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.scans import near, thinned
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.similarity import icp_model
from lhdmap.landmarks.target import IcpModel, Target, prepare
from lhdmap.messages import FloatArray
from lhdmap.topology.driven import arc_m
from lhdmap.topology.model import TopologicalMap, Tunnel

NEAR_LANDMARKS, KEYS_WITHIN_M = 5, 50.0
_SHIFTS_M = np.arange(-8.0, 8.1, 1.0)  # as the similarities between landmarks were found
_KEPT_TARGETS = 64  # of 1.5 MB
_ACROSS = 0.3  # share of a scan that an intersection's cloud must hold: it is of many places


class Seen:
    """A landmark on which a scan was placed: the machine's pose (3,) in the node, and the fitness (m²)."""

    def __init__(self, pose: FloatArray, fitness: float) -> None:
        self.pose, self.fitness = pose, fitness


class PaperNodes:
    """Tells poses on tunnels' axes, and what landmarks say of a scan."""

    def __init__(self, topology: TopologicalMap, landmarks: Landmarks, settings: LandmarkSettings) -> None:
        self.topology = topology
        self._landmarks, self._settings, self._model = landmarks, settings, icp_model(settings)
        wide = 3.0 * settings.range_m
        self._whole = IcpModel(settings.limit_m, wide, 0.0, _ACROSS, settings.fitness == "line")
        self._frames = {node.id: node.pose_map_node[[0, 1, 3]] for node in topology.nodes.values()}
        self._rows = {node: landmarks.of(node) for node in topology.nodes}
        self._arcs = {tunnel.id: arc_m(tunnel.line_m) for tunnel in topology.tunnels}
        self._target = functools.lru_cache(_KEPT_TARGETS)(self._prepared)

    def on_axis(self, tunnel: Tunnel, rho_m: float, lateral_m: float) -> tuple[FloatArray, float]:
        """Return the place (2,) in `map` at `rho_m` along a tunnel and beside it, and the axis' heading there."""
        line, along = tunnel.line_m[:, :2], self._arcs[tunnel.id]
        k = int(np.clip(np.searchsorted(along, rho_m) - 1, 0, len(along) - 2))
        way = line[k + 1] - line[k]
        share = (rho_m - along[k]) / max(along[k + 1] - along[k], 1e-9)
        heading = math.atan2(way[1], way[0])
        aside = lateral_m * np.array([-math.sin(heading), math.cos(heading)])
        return line[k] + share * way + aside, heading

    def cloud(self, points: FloatArray) -> FloatArray:
        """Return the hits (N, 2) of a scan as a landmark's cloud: within the range of the centre, one a cell."""
        s = self._settings
        return thinned(near(points, s.range_m, s.centre_m), s.voxel_m)

    def most_similar(self, node: str, rho_m: float, pose: FloatArray, cloud: FloatArray) -> Seen | None:
        """Return what the most similar landmark of a tunnel says of a cloud seen at about `pose` (3,), in `map`.

        The landmarks near by start where they are expected, keys within 50 m from shifts along the axis; each must be met by its
        own threshold, the least fitness of them counts.
        """
        rows, marks = self._rows[node], self._landmarks
        expected = se2.between(self._frames[node], pose)
        apart = np.abs(marks.at_m[rows] - rho_m)
        close = set(rows[np.argsort(apart, kind="stable")[:NEAR_LANDMARKS]].tolist())
        keys = set(rows[marks.key[rows] & (apart <= KEYS_WITHIN_M)].tolist()) - close
        best: Seen | None = None
        for k in sorted(close | keys):
            fit = self._fit(k, expected, cloud, far=k in keys)
            if fit.valid and fit.fitness <= marks.threshold[k] and (best is None or fit.fitness < best.fitness):
                best = Seen(self._in_map(node, k, fit), float(fit.fitness))
        return best

    def in_intersection(self, node: str, pose: FloatArray, cloud: FloatArray) -> Seen | None:
        """Return what the one landmark of an intersection says of a cloud seen at about `pose` (3,), in `map`."""
        rows = self._rows[node]
        if not len(rows):
            return None
        k = int(rows[0])
        fit = align(self._target(k, True), cloud, se2.between(self._frames[node], pose), self._whole)
        return Seen(self._in_map(node, k, fit), float(fit.fitness)) if fit.valid else None

    def _fit(self, k: int, expected: FloatArray, cloud: FloatArray, *, far: bool) -> IcpFit:
        start = se2.between(self._landmarks.poses_node[k], expected)
        if not far:
            return align(self._target(k, False), cloud, start, self._model)
        facing = 0.0 if math.cos(start[2]) > 0.0 else math.pi
        starts = np.column_stack([_SHIFTS_M, np.zeros(len(_SHIFTS_M)), np.full(len(_SHIFTS_M), facing)])
        return best_of(self._target(k, False), cloud, starts, self._model)

    def _in_map(self, node: str, k: int, fit: IcpFit) -> FloatArray:
        in_node = se2.compose(self._landmarks.poses_node[k], fit.pose)
        pose: FloatArray = se2.compose(self._frames[node], in_node)
        return pose

    def _prepared(self, k: int, whole: bool) -> Target:
        return prepare(self._landmarks.cloud(k).astype(np.float64), self._whole if whole else self._model)
