"""Which node of a topological map a place is in, and what it is called."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap

_HEIGHT = 2.0  # a metre of height is as far as so many in plan: levels
_ARMS = 12
_STEP_M = 1.0
_AT_WAYPOINT_M = 2.0


class Lookup:
    """Answers for many places at once."""

    def __init__(self, topology: TopologicalMap) -> None:
        self._topology = topology
        points, owner = [], []
        for tunnel in topology.tunnels:
            points.append(each_metre(tunnel.line_m))
            owner += [tunnel.id] * len(points[-1])
        for node in topology.intersections:
            middle = node.pose_map_node[:3]
            inner = [middle[None]]
            for point in topology.points_of(node.id):
                share = np.linspace(0.0, 1.0, _ARMS)[:-1, None]
                inner.append(middle + share * (point.pose[:3] - middle))
            points += inner
            owner += [node.id] * sum(map(len, inner))
        self._owner = owner
        self._tree = KDTree(np.vstack([np.zeros((0, 3)), *points]) * [1.0, 1.0, _HEIGHT])

    def nodes_at(self, points_m: FloatArray, within_m: float = np.inf) -> list[str]:
        """Return the ids of the nodes that points (N, 3) are in; empty where none is nearer than `within_m`."""
        if not self._owner:
            return [""] * len(points_m)
        apart, near = self._tree.query(points_m * [1.0, 1.0, _HEIGHT])
        return [self._owner[k] if far <= within_m else "" for far, k in zip(apart, near, strict=True)]

    def names_at(self, points_m: FloatArray, within_m: float = np.inf) -> list[str]:
        """Return the names of the nodes at points (N, 3), of waypoints where one is right there."""
        ids = self.nodes_at(points_m, within_m)
        names = [self._topology.nodes[one].name if one else "" for one in ids]
        for waypoint in self._topology.waypoints:
            near = np.flatnonzero(np.linalg.norm(points_m - waypoint.pose[:3], axis=1) < _AT_WAYPOINT_M)
            for row in near.tolist():
                if names[row]:
                    names[row] = waypoint.name
        return names


def each_metre(line_m: FloatArray) -> FloatArray:
    """Return points (M, 3) at most a metre apart on a line (N, 3)."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    at = np.unique(np.concatenate([way, np.arange(0.0, way[-1], _STEP_M)]))
    return np.column_stack([np.interp(at, way, column) for column in line_m.T])
