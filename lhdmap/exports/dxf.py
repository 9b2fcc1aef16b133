"""A drawing (DXF R2018, metres) for mine planning, with heights.

Walls, centre lines, nodes, access points, waypoints and control points have a layer each.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.exports.content import FREE_SPACE, Content, table_in_map
from lhdmap.exports.outline import floor_of, walls
from lhdmap.extras import library
from lhdmap.topology.geojson import from_geojson
from lhdmap.topology.model import Point

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace

TEXT_M = 0.8
LAYERS = {"WALLS": 7, "CENTRELINE": 5, "NODES": 3, "ACCESS_POINTS": 1, "WAYPOINTS": 6, "CONTROL_POINTS": 30}
"""Layers and their colours (AutoCAD colour index)."""
_METRES = 6  # of $INSUNITS
_AHEAD_M, _GAP_M = 1.2, 0.3
_ARROW_M = ((-1.0, 0.0), (1.0, 0.0), (0.4, 0.35), (1.0, 0.0), (0.4, -0.35))


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the drawing."""
    drawing = library("ezdxf.filemanagement").new("R2018", units=_METRES)
    for name, colour in LAYERS.items():
        drawing.layers.add(name, color=colour)
    drawing.blocks.new("ARROW").add_lwpolyline(_ARROW_M)
    drawing.blocks.new("MARK").add_circle((0.0, 0.0), 0.25)
    space = drawing.modelspace()
    _walls(space, content)
    _nodes(space, content)
    for layer, points in (("ACCESS_POINTS", content.topology.access_points), ("WAYPOINTS", content.topology.waypoints)):
        for point in points:
            _arrow(space, layer, point)
    _control_points(space, content)
    _show_all(drawing, space)
    drawing.saveas(at(path), encoding="utf-8")
    return dict(Counter(entity.dxf.layer for entity in space))


def _walls(space: Modelspace, content: Content) -> None:
    """Draw the free space's outlines, where the map has them, at the height of the floor beside them."""
    if not (content.folder.path / FREE_SPACE).is_file():
        return
    topology = from_geojson(table_in_map(content.folder))
    lines = [one.line_m for one in topology.tunnels] + [one.line_m for one in topology.connections]
    floor = floor_of(lines)
    for sheet in content.sheets:
        for line in walls(sheet, floor):
            ring = content.in_frame(line[:-1]).tolist()
            space.add_polyline3d(ring, close=True, dxfattribs={"layer": "WALLS"})


def _nodes(space: Modelspace, content: Content) -> None:
    for tunnel in content.topology.tunnels:
        space.add_polyline3d(tunnel.line_m.tolist(), dxfattribs={"layer": "CENTRELINE"})
        _text(space, "CENTRELINE", tunnel.name, tunnel.line_m[len(tunnel.line_m) // 2].tolist())
    for node in content.topology.intersections:
        x, y, z = node.pose_map_node[:3].tolist()
        ring = [(*point, z) for point in node.outline_m.tolist()]
        if ring:
            space.add_polyline3d(ring, close=True, dxfattribs={"layer": "NODES"})
        _text(space, "NODES", node.name, [x, y, z])


def _arrow(space: Modelspace, layer: str, point: Point) -> None:
    """Draw an arrow and, before its head, the name: that of its twin, which faces the other way, is behind it."""
    x, y, z, yaw = point.pose.tolist()
    space.add_blockref("ARROW", (x, y, z), {"layer": layer, "rotation": math.degrees(yaw) % 360.0})
    ahead = [x + _AHEAD_M * math.cos(yaw), y + _AHEAD_M * math.sin(yaw), z]
    _text(space, layer, getattr(point, "name", point.id), ahead, to_left=math.cos(yaw) < -0.5)


def _control_points(space: Modelspace, content: Content) -> None:
    """Draw the control points where the grid has them, or in `map` where the map has them."""
    key = "map_m" if content.T_grid_map is None else "grid_m"
    for point in (content.registration or {}).get("control_points", ()):
        space.add_blockref("MARK", point[key], {"layer": "CONTROL_POINTS"})
        _text(space, "CONTROL_POINTS", str(point["name"]), point[key])


def _text(space: Modelspace, layer: str, text: str, at: list[float], *, to_left: bool = False) -> None:
    """Write a text to the right of a place, or to its left."""
    alignment = library("ezdxf.enums").TextEntityAlignment
    side = alignment.MIDDLE_RIGHT if to_left else alignment.MIDDLE_LEFT
    x, y, z = at
    place = (x - _GAP_M if to_left else x + _GAP_M, y, z)
    space.add_text(text, height=TEXT_M, dxfattribs={"layer": layer}).set_placement(place, align=side)


def _show_all(drawing: Drawing, space: Modelspace) -> None:
    """Have the drawing open on what is in it, not on the grid's origin far away."""
    box = library("ezdxf.bbox").extents(space, fast=True)
    if box.has_data:
        drawing.set_modelspace_vport(height=1.1 * max(box.size.y, 1.0), center=(box.center.x, box.center.y))
