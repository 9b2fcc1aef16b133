"""Which node of a topological map a place is in, and what it is called."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap

_HEIGHT = 2.0  # a metre of height is as far as so many in plan: levels
_ARMS = 12
_AT_WAYPOINT_M = 2.0


class Lookup:
    """Answers for many places at once."""

    def __init__(self, topology: TopologicalMap) -> None:
        self._topology = topology
        points, owner = [], []
        for tunnel in topology.tunnels:
            points.append(tunnel.line_m)
            owner += [tunnel.id] * len(tunnel.line_m)
        for node in topology.intersections:
            middle = node.T_map_node[:3]
            inner = [middle[None]]
            for point in topology.points_of(node.id):
                share = np.linspace(0.0, 1.0, _ARMS)[:-1, None]
                inner.append(middle + share * (point.pose[:3] - middle))
            points += inner
            owner += [node.id] * sum(map(len, inner))
        self._owner = owner
        places = np.vstack(points) if points else np.zeros((1, 3))
        self._tree = KDTree(places * [1.0, 1.0, _HEIGHT])

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
