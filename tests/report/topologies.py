"""Topological maps to draw: a level like a chessboard, and two levels with a ramp between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lhdmap.topology.model import DEAD_END, Intersection, TopologicalMap, Waypoint
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet

from tests.topology.maps import ladder, pose, straight, tunnel

SPACING_M, ARM_M = 40.0, 6.0


def board(rows: int, columns: int) -> TopologicalMap:
    """Intersections N1, N2, … in rows, tunnels R… between neighbours of a row, a stope with a waypoint S… below each."""
    nodes, tunnels, waypoints = [], [], []
    for number in range(rows * columns):
        x, y = SPACING_M * (number % columns), SPACING_M * (number // columns)
        corners = np.array([[x - 4, y - 4], [x + 4, y - 4], [x + 4, y + 4], [x - 4, y + 4]], dtype=float)
        nodes.append(Intersection(f"n{number}", f"N{number}", 3, pose(x, y, 0.0), corners))
        foot = pose(x, y - 18.0, -90.0)
        tunnels.append(tunnel(f"S{number}", (f"n{number}", DEAD_END), straight(pose(x, y - ARM_M, 0.0), foot)))
        waypoints.append(Waypoint(f"w{number}", f"S{number}", f"s{number}", foot, "draw_point"))
        if number % columns:
            line = straight(pose(x - SPACING_M + ARM_M, y, 0.0), pose(x - ARM_M, y, 0.0))
            tunnels.append(tunnel(f"R{number}", (f"n{number - 1}", f"n{number}"), line))
    return TopologicalMap(tuple(tunnels), tuple(nodes), (), tuple(waypoints))


def two_levels() -> tuple[TopologicalMap, list[Sheet]]:
    """The ladder at 0 m, the tunnel D from its I2 down to -20 m, and Z at -20 m that D leads to; with the sheet of each level."""
    upper = ladder()
    down = np.linspace([66.0, 0.0, 0.0], [266.0, 0.0, -20.0], 201)
    deep = straight(pose(278.0, 0.0, 0.0, -20.0), pose(330.0, 0.0, 0.0, -20.0))
    tunnels = (*upper.tunnels, tunnel("D", ("i2", "i3"), down), tunnel("Z", ("i3", DEAD_END), deep))
    node = Intersection(
        "i3", "I3", 3, pose(272.0, 0.0, 0.0, -20.0), np.array([[268.0, -4.0], [276.0, -4.0], [272.0, 4.0]]), "deep"
    )
    topology = replace(upper, tunnels=tunnels, intersections=(*upper.intersections, node))
    return topology, [sheet((-20.0, -10.0)), sheet((-9.9, 0.5))]


def sheet(heights_m: tuple[float, float] = (0.0, 0.0), side: int = 40) -> Sheet:
    """A square of free space with a wall round it, from x, y = -10 m on, in cells of 0.5 m."""
    cells = np.full((side, side), FREE, dtype=np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    cells[0, 0] = UNKNOWN
    return Sheet(cells, np.array([-10.0, -10.0]), 0.5, float(np.mean(heights_m)), heights_m)


def told() -> TopologicalMap:
    """The ladder with one of each kind: T2 only seen, T1 closed, T3 unexplored, an infeasible and a closed connection."""
    plain = ladder()
    t1, t2, t3 = plain.tunnels
    first, second, *rest = plain.connections
    return replace(
        plain,
        tunnels=(replace(t1, closed=True), replace(t2, driven=False), replace(t3, ends=("i1", "unexplored"))),
        connections=(replace(first, feasible=False, reason="narrow"), replace(second, closed=True), *rest),
    )
