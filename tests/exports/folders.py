"""Map folders made by hand: the ladder of `tests.topology.maps`, its free space drawn by hand, and a cloud of its walls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.ply import write_ply
from lhdmap.mapfolder import MapFolderWriter
from lhdmap.messages import FloatArray
from lhdmap.runfolder import RunInfo
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet, write_sheets
from lhdmap.trajectory import Trajectory

from tests.topology.maps import ladder

CELL_M = 0.5
TURN_RAD, SHIFT_M = 0.6, np.array([712_345.678, 9_123_456.789, -432.1])
"""The true place of the map in the grid."""


def in_grid(points_map: FloatArray) -> FloatArray:
    """The truth, by matrices: points (N, 3) of the map in the grid."""
    c, s = np.cos(TURN_RAD), np.sin(TURN_RAD)
    return points_map @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T + SHIFT_M


def street(width_m: float = 5.0, height_m: float = 0.0) -> Sheet:
    """A street from (-10, 0) to (70, 0): free inside, walls one cell thick round it, unknown beyond."""
    origin = np.array([-20.0, -10.0])
    y, x = np.mgrid[0:40, 0:200] * CELL_M + CELL_M / 2
    x, y = x + origin[0], y + origin[1]
    inside = (np.abs(y) < width_m / 2) & (x > -10.0) & (x < 70.0)
    around = (np.abs(y) < width_m / 2 + CELL_M) & (x > -10.0 - CELL_M) & (x < 70.0 + CELL_M)
    cells = np.where(inside, FREE, np.where(around, OCCUPIED, 0)).astype(np.uint8)
    return Sheet(cells, origin, CELL_M, height_m, (height_m - 0.2, height_m + 0.2))


def sloping_ladder() -> TopologicalMap:
    """The ladder, with T1 rising by 3 m in its middle."""
    tunnel = ladder().tunnels[0]
    line = tunnel.line_m.copy()
    line[:, 2] = 3.0 * np.sin(np.linspace(0.0, np.pi, len(line)))
    first, *others = ladder().connections
    connections = (replace(first, line_m=line), *others)
    return replace(ladder(), tunnels=(replace(tunnel, line_m=line), *ladder().tunnels[1:]), connections=connections)


def cloud() -> GridCloud:
    rng = np.random.default_rng(1)
    points = rng.uniform((-10.0, -2.5, 0.0), (70.0, 2.5, 4.0), (500, 3)).astype(np.float32)
    normals = rng.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    stamps = 1_600_000_000_123_456_789 + np.arange(500, dtype=np.int64)
    return GridCloud(points, normals.astype(np.float32), stamps_ns=stamps)


def map_folder(
    target: Path, topology: TopologicalMap | None = None, sheets: list[Sheet] | None = None, *, plain: bool = False
) -> Path:
    """A map folder with topology, free space and cloud; `plain`: of before, without the first two."""
    with MapFolderWriter(target) as folder:
        write_ply(folder.path / "cloud.ply", cloud())
        stamps = np.arange(3, dtype=np.int64)
        positions = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [60.0, 0.0, 0.0]])
        folder.write_trajectory(Trajectory(stamps, positions, np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))))
        if not plain:
            folder.write_json("topology.geojson", to_geojson(ladder() if topology is None else topology))
            write_sheets(folder.path / "free_space.npz", [street()] if sheets is None else sheets)
        return folder.complete(RunInfo())


MARKS_M = {"A": (0.0, 2.0, 1.5), "B": (60.0, -2.0, 1.0), "C": (30.0, 28.0, 2.0), "D": (2.0, -20.0, 1.2)}


def control_points(path: Path, shift: dict[str, tuple[float, float, float]] | None = None, scale: float = 1.0) -> Path:
    """A CSV file of the marks; some may be shifted in the grid (m), all lengths scaled."""
    lines = ["name,x,y,z,E,N,Z"]
    for name, at in MARKS_M.items():
        grid = in_grid(scale * np.array(at)) + np.array((shift or {}).get(name, (0.0, 0.0, 0.0)))
        lines.append(",".join([name, *(f"{v:.4f}" for v in at), *(f"{v:.4f}" for v in grid)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
