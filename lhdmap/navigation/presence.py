"""Which nodes of a map a machine reaches into with any part of it, by a place and the angle of its joint."""

from __future__ import annotations

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.geometry import se2
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap

_APART_M = 1.0  # points along the middle of a body


class Presence:
    """Of one machine on one map; `more_m`: so much longer at both ends than it is, for places that are not known exactly."""

    def __init__(self, topology: TopologicalMap, bodies: Bodies, machine: Machine, more_m: float = 0.0) -> None:
        self._lookup, self._machine = Lookup(topology), machine
        self._front_m, self._rear_m = _middle(bodies.front_box_m, 0.0, more_m), _middle(bodies.rear_box_m, more_m, 0.0)

    def nodes(self, pose_map: FloatArray, height_m: float, articulation_rad: float) -> frozenset[str]:
        """Return the nodes (ids) at a place of `base_link` (3,: x, y, yaw) in `map`."""
        T = T_base_rear(articulation_rad, self._machine)
        T_map_rear = se2.compose(pose_map, np.array([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])]))
        flat = np.concatenate([se2.transform(pose_map, self._front_m), se2.transform(T_map_rear, self._rear_m)])
        return frozenset(self._lookup.nodes_at(np.column_stack([flat, np.full(len(flat), height_m)])))

    def node_at(self, pose_map: FloatArray, height_m: float) -> str:
        """Return the node (id) that `base_link` itself is in."""
        return self._lookup.nodes_at(np.array([[pose_map[0], pose_map[1], height_m]]))[0]


def _middle(body_m: FloatArray, behind_m: float, before_m: float) -> FloatArray:
    """Return points (N, 2) along the middle of a body."""
    (x0, _), (x1, _) = body_m.tolist()
    x0, x1 = x0 - behind_m, x1 + before_m
    x = np.linspace(x0, x1, max(int(np.ceil((x1 - x0) / _APART_M)), 1) + 1)
    return np.column_stack([x, np.zeros(len(x))])
