"""Maps of fused walls made from the tunnels of `tests.landmarks.worlds`, without the similarities that nobody asks for here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from lhdmap.geometry import se2
from lhdmap.landmarks.model import Landmarks, NodeSurface
from lhdmap.landmarks.quality import UNMEASURED
from lhdmap.landmarks.surface import fused
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel

from tests.landmarks.worlds import TunnelWorld, drive

CELL_M = 0.025
NEAR_M = 12.0


def near(points: FloatArray) -> FloatArray:
    """Return the hits (N, 2) near the machine, as the localizer takes them."""
    kept: FloatArray = points[np.hypot(points[:, 0], points[:, 1]) < NEAR_M]
    return kept


def walls_of(worlds: Mapping[str, tuple[TunnelWorld, float]]) -> MapWalls:
    """Return the walls of tunnels by id, each with the height (m) that it lies at."""
    tunnels, surfaces = [], {}
    for name, (world, height_m) in worlds.items():
        frame = world.frame() + np.array([0.0, 0.0, height_m, 0.0])
        line = np.array([[*world.pose(at)[:2], height_m] for at in np.arange(0.0, world.length_m + 0.1)])
        tunnels.append(Tunnel(name, name, (DEAD_END, DEAD_END), line, np.full((len(line), 2), 2.2), frame))
        pose_node_map = se2.inverse(frame[[0, 1, 3]])
        placed = [
            se2.transform(se2.compose(pose_node_map, scan.pose_map_base), near(scan.points_m))
            for scan in drive(world, 1, every_m=0.5)
        ]
        surfaces[name] = NodeSurface(fused(placed, CELL_M), UNMEASURED, None)
    return MapWalls(TopologicalMap(tunnels=tuple(tunnels)), _landmarks(surfaces))


def straight_walls(length_m: float, half_m: float) -> MapWalls:
    """Return the walls of a tunnel along x, perfectly straight and smooth."""
    x = np.arange(0.0, length_m, 0.5 * CELL_M)
    sides = [np.column_stack([x, np.full(len(x), side * half_m)]) for side in (1.0, -1.0)]
    line = np.column_stack([np.arange(0.0, length_m), np.zeros((round(length_m), 2))])
    one = Tunnel("s", "S", (DEAD_END, DEAD_END), line, np.full((len(line), 2), half_m), np.zeros(4))
    return MapWalls(
        TopologicalMap(tunnels=(one,)), _landmarks({"s": NodeSurface(fused(sides, CELL_M), UNMEASURED, None)})
    )


def _landmarks(surfaces: Mapping[str, NodeSurface]) -> Landmarks:
    none = np.zeros(0)
    return Landmarks(
        np.zeros((0, 2), np.float32), np.zeros(1, np.int64), np.zeros((0, 3)), np.zeros(0, np.str_), none, none, none,
        np.zeros(0, np.int32), np.zeros(0, np.bool_), {}, surfaces,
    )  # fmt: skip


def winding_walls(windings: Sequence[tuple[TunnelWorld, float]], *, told: bool = True) -> MapWalls:
    """Return the walls of one tunnel that passes above itself: its windings, each at a height (m).

    `told`: whether the map tells the heights of its walls, as older ones do not.
    """
    frame, placed, heights, line = windings[0][0].frame(), list[FloatArray](), list[float](), list[FloatArray]()
    pose_node_map = se2.inverse(frame[[0, 1, 3]])
    for world, height_m in windings:
        scans = drive(world, 1, every_m=0.5)
        placed += [se2.transform(se2.compose(pose_node_map, one.pose_map_base), near(one.points_m)) for one in scans]
        heights += [height_m] * len(scans)
        line += [np.array([*world.pose(at)[:2], height_m]) for at in np.arange(0.0, world.length_m + 0.1)]
    one = Tunnel("w", "W", (DEAD_END, DEAD_END), np.array(line), np.full((len(line), 2), 2.2), frame)
    cells = fused(placed, CELL_M, heights if told else None)
    return MapWalls(TopologicalMap(tunnels=(one,)), _landmarks({"w": NodeSurface(cells, UNMEASURED, None)}))
