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

_HEIGHT = 2.0  # a metre of height is as far as so many in plan: levels
_STANDS_MPS = 0.05
_ONE_DIRECTION_RAD = math.radians(20.0)


class PlaceOnMap(NamedTuple):
    """In node `node` (id) at `rho_m`, `lateral_m`, `heading_rad`: along a tunnel's line, in an intersection x and y in its frame.

    `next_point`: the next access or waypoint in the direction of motion, empty where there is none; `next_m` to it:
    along a tunnel's line, in an intersection straight.
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
        self._asked, self._node = (math.nan, math.nan, math.nan), ""
        self._along = {tunnel.id: arc_m(tunnel.line_m) for tunnel in topology.tunnels}
        self._points = {node: topology.points_of(node) for node in topology.nodes}
        self._rho_m = {
            point.id: self._in_tunnel(tunnel, point.pose[[0, 1, 3]], point.pose[2])[0]
            for tunnel in topology.tunnels
            for point in self._points[tunnel.id]
        }
        lines = [tunnel.line_m for tunnel in topology.tunnels]
        lines += [node.pose_map_node[None, :3] for node in topology.intersections]
        self._heights = np.vstack(lines) if lines else np.zeros((1, 3))
        self._tree = KDTree(self._heights * [1.0, 1.0, _HEIGHT])

    def height_m(self, x: float, y: float, about_m: float) -> float:
        """Return the floor's height near a place that is about at this height."""
        apart, near = self._tree.query([x, y, _HEIGHT * about_m], k=min(3, len(self._heights)))
        weights = 1.0 / (np.atleast_1d(apart) + 0.5)
        return float((weights * self._heights[np.atleast_1d(near), 2]).sum() / weights.sum())

    def node_at(self, pose: FloatArray, height_m: float) -> str:
        """Return the id of the node that a pose (3,) at a height is in; empty where it is in none."""
        place = float(pose[0]), float(pose[1]), height_m
        if place != self._asked:  # a scan asks for the same place several times
            self._asked, self._node = place, self._lookup.nodes_at(np.array([place]))[0]
        return self._node

    def at(self, pose: FloatArray, height_m: float, speed_mps: float) -> PlaceOnMap:
        """Return the place of a pose (3,) at a height, moving at a signed speed along its heading."""
        node = self.node_at(pose, height_m)
        found = self._topology.nodes.get(node)
        if found is None:
            return PlaceOnMap("", math.nan, math.nan, math.nan, height_m, "", math.nan)
        backward = speed_mps < -_STANDS_MPS  # standing, it is taken to face where it goes
        if isinstance(found, Tunnel):
            rho, lateral, heading = self._in_tunnel(found, pose, height_m)
            name, far = self._next_along(node, rho, math.copysign(1.0, math.cos(heading)) * (-1.0 if backward else 1.0))
        else:
            rho, lateral, heading = se2.between(found.pose_map_node[[0, 1, 3]], pose).tolist()
            name, far = self._next_across(node, pose, pose[2] + (math.pi if backward else 0.0))
        return PlaceOnMap(node, rho, lateral, math.remainder(heading, 2.0 * math.pi), height_m, name, far)

    def along(self, tunnel: Tunnel, pose: FloatArray, height_m: float) -> tuple[float, float]:
        """Return how far along a tunnel's line a pose (3,) is, and how far to its left, whichever node it is in."""
        rho, lateral, _ = self._in_tunnel(tunnel, pose, height_m)
        return rho, lateral

    def _in_tunnel(self, tunnel: Tunnel, pose: FloatArray, height_m: float) -> tuple[float, float, float]:
        """Return distance along the line, to its left, and heading against it; the line may cross above or below itself."""
        line, along = tunnel.line_m[:, :2], self._along[tunnel.id]
        start, way = line[:-1], np.diff(line, axis=0)
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        share = np.clip(((pose[:2] - start) * way).sum(axis=1) / length**2, 0.0, 1.0)
        apart = np.linalg.norm(start + share[:, None] * way - pose[:2], axis=1)
        above = tunnel.line_m[:-1, 2] + share * np.diff(tunnel.line_m[:, 2]) - height_m
        k = int(np.hypot(apart, _HEIGHT * above).argmin())
        unit = way[k] / length[k]
        off = pose[:2] - line[k]
        ends = along[k + 1] - along[k]  # in space: a grade makes it longer than in plan
        rho = float(along[k] + ends * (off @ unit / length[k] if k in (0, len(way) - 1) else share[k]))
        return rho, float(unit[0] * off[1] - unit[1] * off[0]), float(pose[2] - math.atan2(unit[1], unit[0]))

    def _next_along(self, node: str, rho_m: float, sense: float) -> tuple[str, float]:
        """Return the nearest point of a tunnel towards its end (sense 1) or start (-1)."""
        ahead = {point.id: sense * (self._rho_m[point.id] - rho_m) for point in self._points[node]}
        ahead = {name: far for name, far in ahead.items() if far > 0.0}
        name = min(ahead, key=lambda one: ahead[one], default="")
        return name, ahead.get(name, math.nan)

    def _next_across(self, node: str, pose: FloatArray, course_rad: float) -> tuple[str, float]:
        """Return the point of an intersection that lies ahead, least aside of the course; the nearer of two in one direction."""
        best, best_rank = ("", math.nan), (math.inf, math.inf)
        for point in self._points[node]:
            off = point.pose[:2] - pose[:2]
            distance = float(np.linalg.norm(off))
            aside = abs(math.remainder(math.atan2(off[1], off[0]) - course_rad, 2.0 * math.pi))
            rank = round(aside / _ONE_DIRECTION_RAD), distance
            if aside < 0.5 * math.pi and rank < best_rank:
                best, best_rank = (point.id, distance), rank
        return best
