"""The picture of `docs/topology.md`: a topological map over the free space it was found in.

python -m tools.evaluate.topology_picture [--plan level] [--seed 1] [--folder KEPT]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from lhdmap.messages import FloatArray
from lhdmap.topology.build import Topology, topology_of
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

from tools.evaluate.topology_drives import drive_of

TARGET = Path(__file__).resolve().parents[2] / "docs" / "img" / "topology.png"
_PX = 2  # of a cell
_ROCK, _FREE, _WALL = (205, 205, 205), (255, 255, 255), (90, 90, 90)
_TUNNEL, _NODE, _POINT, _STOP, _TEXT = (150, 110, 30), (190, 215, 245), (40, 40, 220), (30, 130, 30), (0, 0, 0)  # BGR
_ARROW_M, _SHIFT = 2.2, 3
Canvas = npt.NDArray[np.uint8]


def picture(topology: Topology, number: int = 0) -> Canvas:
    """Return the picture of one sheet (rows, columns, BGR): intersections, tunnels, access points, waypoints, names."""
    sheet, found = topology.sheets[number], topology.map
    canvas = np.full((*sheet.cells.shape, 3), _ROCK, np.uint8)
    canvas[sheet.cells == FREE] = _FREE
    canvas[sheet.cells == OCCUPIED] = _WALL
    canvas = canvas.repeat(_PX, axis=0).repeat(_PX, axis=1)
    for node in found.intersections:
        cv2.fillPoly(canvas, [_pixels(sheet, node.outline_m)], _NODE, cv2.LINE_AA, _SHIFT)
    for tunnel in found.tunnels:
        cv2.polylines(canvas, [_pixels(sheet, tunnel.line_m)], False, _TUNNEL, 2, cv2.LINE_AA, _SHIFT)
    for point in found.access_points:
        if point.node.startswith("i"):
            _arrow(canvas, sheet, point.pose, _POINT)
    for waypoint in found.waypoints:
        _arrow(canvas, sheet, waypoint.pose, _STOP)
    return _cropped(canvas, sheet)


def _arrow(canvas: Canvas, sheet: Sheet, pose: FloatArray, colour: tuple[int, int, int]) -> None:
    tip = pose[:2] + _ARROW_M * np.array([np.cos(pose[3]), np.sin(pose[3])])
    start, end = _pixels(sheet, np.vstack([pose[:2], tip])) >> _SHIFT
    cv2.arrowedLine(canvas, start.tolist(), end.tolist(), colour, 2, cv2.LINE_AA, 0, 0.45)
    cv2.circle(canvas, start.tolist(), 3, colour, -1, cv2.LINE_AA)


def named(canvas: Canvas, topology: Topology, number: int = 0) -> Canvas:
    """Return the picture turned north up, with the names of intersections and waypoints."""
    sheet = topology.sheets[number]
    low = _low(sheet)
    out = np.ascontiguousarray(canvas[::-1])
    places = [(node.name, node.pose_map_node, (6, -9)) for node in topology.map.intersections]
    places += [(point.name, point.pose, (8, 16)) for point in topology.map.waypoints]
    for name, pose, (right, down) in places:
        x, y = (_pixels(sheet, pose[None, :2])[0] >> _SHIFT) - low
        at = (int(x) + right, out.shape[0] - int(y) + down)
        cv2.putText(out, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, _TEXT, 1, cv2.LINE_AA)
    return out


def _pixels(sheet: Sheet, points_m: FloatArray) -> npt.NDArray[np.int32]:
    scaled = (points_m[:, :2] - sheet.origin_m) / sheet.cell_m * _PX * (1 << _SHIFT)
    return np.round(scaled).astype(np.int32)


def _low(sheet: Sheet) -> npt.NDArray[np.int64]:
    rows, columns = np.nonzero(sheet.cells == FREE)
    return np.array([columns.min(), rows.min()]) * _PX - 10


def _cropped(canvas: Canvas, sheet: Sheet) -> Canvas:
    rows, columns = np.nonzero(sheet.cells == FREE)
    low = np.maximum(_low(sheet), 0)
    cut: Canvas = canvas[low[1] : (rows.max() + 1) * _PX + 10, low[0] : (columns.max() + 1) * _PX + 10]
    return cut


def main(words: list[str] | None = None) -> int:
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plan", default="level")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "lhdmap_topology_drives")
    arguments = parser.parse_args(words)
    topology = topology_of(drive_of(arguments.plan, arguments.seed, arguments.folder).own, TopologySettings())
    from PIL import Image

    image = Image.fromarray(named(picture(topology), topology)[:, :, ::-1])
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(32).save(TARGET, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
