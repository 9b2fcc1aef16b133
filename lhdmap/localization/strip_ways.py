"""The ways that strips of wall profile are made along: lines of tunnels, and curves through intersections from arm to arm."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.topology.driven import arc_m
from lhdmap.topology.model import AccessPoint, Intersection, TopologicalMap, Tunnel

INSIDE_M = 8.0  # of a tunnel that belong to the strips through its intersection
BEYOND_M = 8.0  # of way beside a strip, for its mid line's sake
LEAST_M = 2.0


def access_points(topology: TopologicalMap, node: Intersection) -> list[AccessPoint]:
    """Return the access points of an intersection."""
    return [point for point in topology.points_of(node.id) if isinstance(point, AccessPoint)]


def arm_of(topology: TopologicalMap, point: AccessPoint) -> tuple[AccessPoint, Tunnel, int] | None:
    """Return an intersection's access point with its tunnel and which end of it that is; None where there is none."""
    twin = topology.points.get(point.joins or "")
    tunnel = topology.nodes.get(twin.node) if twin is not None else None
    if twin is None or not isinstance(tunnel, Tunnel) or len(tunnel.line_m) < 2 or tunnel.length_m < LEAST_M:
        return None
    ends = [math.dist(tunnel.line_m[k, :2], twin.pose[:2]) for k in (0, -1)]
    return point, tunnel, int(ends[1] < ends[0])


def inside_m(tunnel: Tunnel) -> float:
    """Return how much of a tunnel belongs to the strips through each of its intersections, metres."""
    return min(INSIDE_M, 0.5 * (tunnel.length_m - 1.0))


def tail_of(tunnel: Tunnel, end: int) -> tuple[FloatArray, FloatArray]:
    """Return the line (K, 2) of a tunnel from one of its ends inwards, some metres, and where (2,) its own strip begins."""
    line = tunnel.line_m[:: 1 if end == 0 else -1]
    at = arc_m(line)
    grid = np.arange(0.0, min(inside_m(tunnel) + BEYOND_M, at[-1]) + 1e-6, 0.5)
    return np.column_stack([np.interp(grid, at, column) for column in line.T[:2]]), point_on(line, at, inside_m(tunnel))


def point_on(line: FloatArray, at: FloatArray, place: float) -> FloatArray:
    """Return the point (2,) at a place (m) of a line (K, 3) whose points are at `at` (K,)."""
    return np.array([np.interp(place, at, column) for column in line.T[:2]])


def curve_through(enters: FloatArray, leaves: FloatArray) -> FloatArray:
    """Return a smooth way (K, 2) through an intersection: in against the heading of one access point, out along the other's."""
    apart = math.dist(enters[:2], leaves[:2])
    t = np.linspace(0.0, 1.0, max(int(apart / 0.5), 3))[1:-1, None]
    into = -apart * np.array([math.cos(enters[3]), math.sin(enters[3])])
    out = apart * np.array([math.cos(leaves[3]), math.sin(leaves[3])])
    start, end = enters[:2], leaves[:2]
    way: FloatArray = (
        (2 * t**3 - 3 * t**2 + 1) * start
        + (t**3 - 2 * t**2 + t) * into
        + (3 * t**2 - 2 * t**3) * end
        + (t**3 - t**2) * out
    )
    return way


def extended(way: FloatArray, at: FloatArray, beyond_m: float) -> tuple[FloatArray, FloatArray]:
    """Return a way (K, 2) that goes on straight beyond both ends, and its places (K,)."""
    ends = []
    for points in (way, way[::-1]):
        inner = points[min(len(points) - 1, max(1, int(np.searchsorted(arc_m(points), 2.0))))]
        ends.append(points[0] + (points[0] - inner) / max(math.dist(points[0], inner), 1e-9) * beyond_m)
    return np.vstack([ends[0], way, ends[1]]), np.concatenate([[at[0] - beyond_m], at, [at[-1] + beyond_m]])
