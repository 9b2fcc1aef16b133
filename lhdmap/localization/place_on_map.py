"""Where in its node a pose is: distance along it, beside it, heading, and the next point ahead."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.topology.driven import arc_m
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap, Tunnel


class Place(NamedTuple):
    """In node `node` (id) at `rho_m`, `lateral_m`, `heading_rad`: along a tunnel's line, in an intersection x and y in its frame.

    `next_point`: the next access or waypoint in the direction of motion, empty where there is none; `next_m` to it.
    """

    node: str
    rho_m: float
    lateral_m: float
    heading_rad: float
    height_m: float
    next_point: str
    next_m: float


class Placer:
    """Tells the place of poses on a map."""

    def __init__(self, topology: TopologicalMap) -> None:
        self._topology, self._lookup = topology, Lookup(topology)
        self._along = {tunnel.id: arc_m(tunnel.line_m) for tunnel in topology.tunnels}
        self._points = {node: topology.points_of(node) for node in topology.nodes}
        lines = [tunnel.line_m for tunnel in topology.tunnels]
        lines += [node.T_map_node[None, :3] for node in topology.intersections]
        self._heights = np.vstack(lines) if lines else np.zeros((1, 3))
        self._tree = KDTree(self._heights * [1.0, 1.0, 2.0])

    def height_m(self, x: float, y: float, about_m: float) -> float:
        """Return the floor's height near a place that is about at this height."""
        apart, near = self._tree.query([x, y, 2.0 * about_m], k=min(3, len(self._heights)))
        weights = 1.0 / (np.atleast_1d(apart) + 0.5)
        return float((weights * self._heights[np.atleast_1d(near), 2]).sum() / weights.sum())

    def at(self, pose: FloatArray, height_m: float, speed_mps: float) -> Place:
        """Return the place of a pose (3,) at a height, moving at a signed speed along its heading."""
        node = self._lookup.nodes_at(np.array([[pose[0], pose[1], height_m]]))[0]
        found = self._topology.nodes.get(node)
        if found is None:
            return Place("", math.nan, math.nan, math.nan, height_m, "", math.nan)
        if isinstance(found, Tunnel):
            rho, lateral, heading = self._in_tunnel(found, pose)
        else:
            rho, lateral, heading = se2.between(found.T_map_node[[0, 1, 3]], pose).tolist()
        name, far = self._next(node, pose, speed_mps)
        return Place(node, rho, lateral, math.remainder(heading, 2.0 * math.pi), height_m, name, far)

    def _in_tunnel(self, tunnel: Tunnel, pose: FloatArray) -> tuple[float, float, float]:
        """Return distance along the line, to its left, and heading against it."""
        line, along = tunnel.line_m[:, :2], self._along[tunnel.id]
        start, way = line[:-1], np.diff(line, axis=0)
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        share = np.clip(((pose[:2] - start) * way).sum(axis=1) / length**2, 0.0, 1.0)
        apart = np.linalg.norm(start + share[:, None] * way - pose[:2], axis=1)
        k = int(apart.argmin())
        unit = way[k] / length[k]
        off = pose[:2] - line[k]
        rho = float(along[k] + off @ unit) if k in (0, len(way) - 1) else float(along[k] + share[k] * length[k])
        return rho, float(unit[0] * off[1] - unit[1] * off[0]), float(pose[2] - math.atan2(unit[1], unit[0]))

    def _next(self, node: str, pose: FloatArray, speed_mps: float) -> tuple[str, float]:
        """Return the nearest point of the node that lies ahead in the direction of motion."""
        direction = math.copysign(1.0, speed_mps) if abs(speed_mps) > 0.05 else 1.0
        ahead = direction * np.array([math.cos(pose[2]), math.sin(pose[2])])
        best, far = "", math.inf
        for point in self._points[node]:
            off = point.pose[:2] - pose[:2]
            distance = float(np.linalg.norm(off))
            if off @ ahead > 0.0 and distance < far:
                best, far = point.id, distance
        return best, far if best else math.nan
