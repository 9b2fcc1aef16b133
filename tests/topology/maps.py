"""Topological maps made by hand: their geometry is simple enough to be known by heart."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.topology.model import (
    DEAD_END,
    AccessPoint,
    Connection,
    Intersection,
    Kind,
    TopologicalMap,
    Tunnel,
    Waypoint,
)

REACH_M = 6.0
"""From an intersection's middle to its access points."""


def pose(x: float, y: float, heading_deg: float, z: float = 0.0) -> FloatArray:
    return np.array([x, y, z, math.radians(heading_deg)])


def straight(a: FloatArray, b: FloatArray) -> FloatArray:
    n = max(int(np.linalg.norm(b[:3] - a[:3])), 1) + 1
    line: FloatArray = np.linspace(a[:3], b[:3], n)
    return line


def tunnel(name: str, ends: tuple[str, str], line: FloatArray, half_m: float = 2.25) -> Tunnel:
    yaw = math.atan2(line[1, 1] - line[0, 1], line[1, 0] - line[0, 0])
    return Tunnel(name.lower(), name, ends, line, np.full((len(line), 2), half_m), np.array([*line[0], yaw]))


def intersection(name: str, x: float, y: float, degree: int) -> Intersection:
    corners = np.array([[x - 4.0, y - 4.0], [x + 4.0, y - 4.0], [x + 4.0, y + 4.0], [x - 4.0, y + 4.0]])
    return Intersection(name.lower(), name, degree, pose(x, y, 0.0), corners)


def twins(node: str, of_tunnel: str, tunnel_id: str, outward: FloatArray) -> list[AccessPoint]:
    """Both access points where an intersection's arm and a tunnel meet; `outward` is the pose seen from the intersection."""
    inward = outward + np.array([0.0, 0.0, 0.0, math.pi])
    return [AccessPoint(node, node.split(".")[0], outward, of_tunnel), AccessPoint(of_tunnel, tunnel_id, inward, node)]


def connection(points: dict[str, FloatArray], start: str, end: str, kind: Kind = "back_back") -> Connection:
    line = straight(points[start], points[end])
    return Connection(start, end, kind, line, float(np.linalg.norm(line[-1] - line[0])))


def ladder() -> TopologicalMap:
    """Two intersections I1 (0, 0) and I2 (60, 0): T1 straight between them, T2 a detour to the north, and T3, a dead end to the
    south of I1 with the draw point DP1 26 m from its middle.

    Connections from one arm into another at I1 and I2 are all there; a machine cannot turn in T1.
    """
    a, b = pose(REACH_M, 0.0, 0.0), pose(60.0 - REACH_M, 0.0, 180.0)
    c, d = pose(0.0, REACH_M, 90.0), pose(60.0, REACH_M, 90.0)
    e, dp = pose(0.0, -REACH_M, -90.0), pose(0.0, -26.0, -90.0)
    detour = np.array([c[:3], [0.0, 30.0, 0.0], [60.0, 30.0, 0.0], d[:3]])
    tunnels = (
        tunnel("T1", ("i1", "i2"), straight(a, b)),
        tunnel("T2", ("i1", "i2"), detour),
        tunnel("T3", ("i1", DEAD_END), straight(e, pose(0.0, -30.0, 0.0))),
    )
    access = [
        *twins("i1.t1", "t1.start", "t1", a),
        *twins("i2.t1", "t1.end", "t1", b),
        *twins("i1.t2", "t2.start", "t2", c),
        *twins("i2.t2", "t2.end", "t2", d),
        *twins("i1.t3", "t3.start", "t3", e),
    ]
    points = {one.id: one.pose for one in access} | {"w1": dp}
    along_t2 = Connection("t2.start", "t2.end", "back_back", detour, 108.0)
    connections = [
        connection(points, "t1.start", "t1.end"),
        along_t2,
        connection(points, "t3.start", "w1"),
        *(connection(points, f"i1.{x}", f"i1.{y}") for x, y in (("t1", "t2"), ("t1", "t3"), ("t2", "t3"))),
        connection(points, "i2.t1", "i2.t2"),
    ]
    nodes: Sequence[Intersection] = (intersection("I1", 0.0, 0.0, 3), intersection("I2", 60.0, 0.0, 2))
    waypoint = Waypoint("w1", "DP1", "t3", dp, "draw_point")
    return TopologicalMap(tunnels, tuple(nodes), tuple(access), (waypoint,), tuple(connections))
