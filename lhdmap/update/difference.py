"""What is different between two versions of a map: walls that came and went, tunnels that are new, nodes that moved."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.topology.model import Intersection, TopologicalMap, Tunnel
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

_APART_M = 0.6  # of a wall from all walls of the other version: nearer ones are roughness and noise
_SAME_NODE_M, _ALONG = 6.0, 0.5
_LEAST_AREA_M2 = 1.0
_WIDTH_M = 0.5
_MOVED_M = 0.5


class Walls(NamedTuple):
    """Cells (N, 2: x, y) whose walls came and went, and the new free area, m²."""

    came_m: FloatArray
    went_m: FloatArray
    area_new_m2: float
    cell_m: float


def walls_between(before: Sheet, after: Sheet) -> Walls:
    """Return what changed on one level."""
    old_wall, old_free = _on(before, after, OCCUPIED), _on(before, after, FREE)
    new_wall, new_free = after.cells == OCCUPIED, after.cells == FREE
    came = new_wall & old_free & (_distance_m(old_wall, after.cell_m) > _APART_M)
    went = old_wall & new_free & (_distance_m(new_wall, after.cell_m) > _APART_M)
    area = float((new_free & ~old_free & ~old_wall).sum()) * after.cell_m**2
    return Walls(
        after.middles_m(np.argwhere(_cleaned(came, after.cell_m))),
        after.middles_m(np.argwhere(_cleaned(went, after.cell_m))),
        area,
        after.cell_m,
    )


def _on(sheet: Sheet, grid: Sheet, value: int) -> npt.NDArray[np.bool_]:
    """Return the cells of a sheet that have a value, on another sheet's grid."""
    out = np.zeros(grid.cells.shape, bool)
    cells = grid.at(sheet.middles_m(np.argwhere(sheet.cells == value)))
    inside = ((cells >= 0) & (cells < grid.cells.shape)).all(axis=1)
    out[cells[inside, 0], cells[inside, 1]] = True
    return out


def _distance_m(walls: npt.NDArray[np.bool_], cell_m: float) -> npt.NDArray[np.float32]:
    return cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * cell_m


def _cleaned(cells: npt.NDArray[np.bool_], cell_m: float) -> npt.NDArray[np.bool_]:
    """Return the cells without patches that are smaller than a wall of a metre."""
    near = cv2.dilate(cells.astype(np.uint8), np.ones((3, 3), np.uint8))
    _, labels, figures, _ = cv2.connectedComponentsWithStats(near, connectivity=8)
    extent = np.hypot(figures[:, 2], figures[:, 3]) * cell_m
    return cells & (extent[labels] > _LEAST_AREA_M2)


def difference(
    before: TopologicalMap, after: TopologicalMap, sheets: tuple[list[Sheet], list[Sheet]]
) -> tuple[dict[str, Any], list[Walls]]:
    """Return the difference report as JSON values, and the changed walls of each level of the newer version."""
    walls = [walls_between(_alike(sheets[0], sheet), sheet) for sheet in sheets[1]] if sheets[0] else []
    old_tunnels = {one.id: one for one in before.tunnels}
    pairs = {new.id: _counterpart(new, list(old_tunnels.values())) for new in after.tunnels}
    used = {old.id for old in pairs.values() if old is not None}
    table = {
        "from_version": before.version,
        "to_version": after.version,
        "tunnels_new": [one.name for one in after.tunnels if pairs[one.id] is None],
        "tunnels_gone": [one.name for one in before.tunnels if one.id not in used],
        "tunnels_changed": [
            _changed(old, new) for new in after.tunnels if (old := pairs[new.id]) is not None and _differs(old, new)
        ],
        "nodes_moved": _moved(before.intersections, after.intersections),
        "nodes_new": [one.name for one in after.intersections if _nearest(one, before.intersections) is None],
        "waypoints_new": sorted({one.name for one in after.waypoints} - {one.name for one in before.waypoints}),
        "walls": [
            {
                "level": level,
                "came_m2": len(one.came_m) * one.cell_m**2,
                "went_m2": len(one.went_m) * one.cell_m**2,
                "new_free_m2": one.area_new_m2,
                "came_at_m": _middle(one.came_m),
                "went_at_m": _middle(one.went_m),
            }
            for level, one in enumerate(walls)
        ],
    }
    return table, walls


def _alike(sheets: list[Sheet], sheet: Sheet) -> Sheet:
    """Return the sheet of the other version that is at this one's height."""
    return min(sheets, key=lambda one: abs(one.height_m - sheet.height_m))


def _counterpart(tunnel: Tunnel, others: list[Tunnel]) -> Tunnel | None:
    """Return the other version's tunnel that most of this one runs along, None where none does."""
    best, most = None, _ALONG
    for other in others:
        apart = np.linalg.norm(tunnel.line_m[:, None] - other.line_m[None], axis=2).min(axis=1)
        share = float((apart < 2.0).mean())
        if share >= most:
            best, most = other, share
    return best


def _differs(old: Tunnel, new: Tunnel) -> bool:
    narrower = abs(float(old.widths_m.min()) - float(new.widths_m.min())) > _WIDTH_M
    return narrower or abs(old.length_m - new.length_m) > max(1.0, 0.02 * old.length_m) or old.ends != new.ends


def _changed(old: Tunnel, new: Tunnel) -> dict[str, Any]:
    return {
        "name": new.name,
        "length_m": [round(old.length_m, 2), round(new.length_m, 2)],
        "width_min_m": [round(float(old.widths_m.min()), 2), round(float(new.widths_m.min()), 2)],
    }


def _nearest(node: Intersection, others: tuple[Intersection, ...]) -> Intersection | None:
    near = [one for one in others if math.dist(one.pose_map_node[:3], node.pose_map_node[:3]) < _SAME_NODE_M]
    return min(near, key=lambda one: math.dist(one.pose_map_node[:3], node.pose_map_node[:3]), default=None)


def _moved(before: tuple[Intersection, ...], after: tuple[Intersection, ...]) -> list[dict[str, Any]]:
    found = []
    for node in after:
        old = _nearest(node, before)
        if old is None:
            continue
        by_m = math.dist(old.pose_map_node[:3], node.pose_map_node[:3])
        if by_m > _MOVED_M or old.degree != node.degree:
            found.append({"name": node.name, "by_m": round(by_m, 3), "degree": [old.degree, node.degree]})
    return found


def _middle(points_m: FloatArray) -> list[float] | None:
    return None if not len(points_m) else [round(float(value), 2) for value in np.median(points_m, axis=0)]
