"""Nodes from arcs: intersections with their access points, tunnels between them, in the order in which the drive came to them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.arcs import Arc, Heights, Mouth, resampled
from lhdmap.topology.driven import arc_m
from lhdmap.topology.graph import Graph

_LEAST_TUNNEL_M = 1.0
_FACE_M = 3
_GRADE_M = 10.0  # of line over which a grade is taken
_OUTLINE_SLACK_M = 0.15

Junction = tuple[int, int]


@dataclass(slots=True)
class RawNode:
    """An intersection on its way into the map: junction (sheet, vertex), middle (3,), mouths by arc and end."""

    junction: Junction
    middle_m: FloatArray
    heading_rad: float
    mouths: list[tuple[int, int]] = field(default_factory=list)  # arc, end (0 start, 1 end)
    outline_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))


@dataclass(slots=True)
class RawTunnel:
    """A tunnel on its way into the map: its arc, the line (N, 3) and room (N, 2) between its access points, and these (4,)."""

    arc: Arc
    line_m: FloatArray
    room_m: FloatArray
    access: tuple[FloatArray | None, FloatArray | None]  # heading out of the tunnel


@dataclass(slots=True)
class RawMap:
    """Nodes and tunnels; `visits` of either: when the drive first came there (row of its path)."""

    nodes: list[RawNode]
    tunnels: list[RawTunnel]


def raw_map(arcs: list[Arc], graphs: list[Graph], heights: list[Heights], path: FloatArray) -> RawMap:
    """Return nodes and tunnels in the order in which a drive along `path` (M, 3) came to them first."""
    arcs = _in_order(arcs, path)
    tunnels = [_tunnel(arc) for arc in arcs]
    nodes: dict[Junction, RawNode] = {}
    for number, arc in enumerate(arcs):
        for end, mouth in enumerate(arc.ends):
            if isinstance(mouth, Mouth):
                nodes.setdefault(mouth.junction, _node(mouth, heights)).mouths.append((number, end))
    ordered = sorted(nodes.values(), key=lambda node: _first_near(path, node.middle_m[None]))
    for node in ordered:
        graph = graphs[node.junction[0]]
        access = [tunnels[number].access[end] for number, end in node.mouths]
        node.outline_m = outline_of(graph, node.middle_m[:2], [pose for pose in access if pose is not None])
    return RawMap(ordered, tunnels)


def _in_order(arcs: list[Arc], path: FloatArray) -> list[Arc]:
    """Return the arcs in the order of first visits, each in the direction in which it was driven first; seen ones last."""
    tree = KDTree(path[:, :2])
    rows = []
    for arc in arcs:
        middle = arc.points_m[len(arc.points_m) // 4 : max(3 * len(arc.points_m) // 4, 1)]
        near = tree.query_ball_point(middle[:, :2], 4.0)
        ok = [
            [row for row in found if abs(path[row, 2] - point[2]) < 2.5]
            for found, point in zip(near, middle, strict=True)
        ]
        firsts = [min(found) for found in ok if found]
        rows.append((min(firsts) if firsts else len(path), firsts))
    ordered = []
    for index in sorted(range(len(arcs)), key=lambda k: (not arcs[k].driven, rows[k][0])):
        arc, firsts = arcs[index], rows[index][1]
        backwards = len(firsts) > 1 and firsts[0] > firsts[-1]
        dead = isinstance(arc.ends[0], str) and not isinstance(arc.ends[1], str)
        both_open = isinstance(arc.ends[0], str) == isinstance(arc.ends[1], str)
        ordered.append(arc.reversed() if dead or (both_open and backwards) else arc)
    return ordered


def _first_near(path: FloatArray, points_m: FloatArray) -> int:
    """Return the first row of the path within 6 m of points (N, 3), or else the nearest one."""
    apart = np.linalg.norm(path[:, None, :] - points_m[None], axis=2).min(axis=1)
    near = np.flatnonzero(apart < 6.0)
    return int(near[0]) if len(near) else int(apart.argmin())


def _node(mouth: Mouth, heights: list[Heights]) -> RawNode:
    z = float(heights[mouth.junction[0]].at(mouth.middle_m[None])[0])
    return RawNode(mouth.junction, np.array([*mouth.middle_m, z]), mouth.axis.heading_rad)


def _tunnel(arc: Arc) -> RawTunnel:
    """Return the part of an arc between its access points: these lie on the arms' axes, where the junctions end."""
    start, end = arc.ends
    reaches = [mouth.reach_m if isinstance(mouth, Mouth) else 0.0 for mouth in (start, end)]
    span = float(arc_m(arc.points_m[:, :2])[-1])
    if sum(reaches) > max(span - _LEAST_TUNNEL_M, 0.5 * span):
        scale = max(span - _LEAST_TUNNEL_M, 0.5 * span) / sum(reaches)
        reaches = [scale * reach for reach in reaches]
    first = _from(arc.points_m, start, reaches[0])
    last = len(arc.points_m) - _from(arc.points_m[::-1], end, reaches[1])
    last = max(last, first + 1)
    points, room = arc.points_m[first:last], arc.room_m[first:last]
    access: list[FloatArray | None] = []
    for mouth, reach, near in ((start, reaches[0], points[0]), (end, reaches[1], points[-1])):
        access.append(_access(mouth, reach, float(near[2])) if isinstance(mouth, Mouth) else None)
    if access[0] is not None:
        points, room = np.vstack([access[0][None, :3], points]), np.vstack([room[:1], room])
    if access[1] is not None:
        points, room = np.vstack([points, access[1][None, :3]]), np.vstack([room, room[-1:]])
    room = _walled(room, arc)
    along = arc_m(points)
    line = resampled(points, 1.0)
    wanted = np.linspace(0.0, along[-1], len(line))
    sides = np.column_stack([np.interp(wanted, along, column) for column in room.T])
    return RawTunnel(arc, line, sides, (access[0], access[1]))


def _walled(room: FloatArray, arc: Arc) -> FloatArray:
    """Return the room (N, 2) with that of the last metres before a dead end's face as it is before them."""
    room, count = room.copy(), min(_FACE_M, len(room) // 3)
    if isinstance(arc.ends[0], str) and count:
        room[:count] = room[count]
    if isinstance(arc.ends[1], str) and count:
        room[-count:] = room[-count - 1]
    return room


def _from(points_m: FloatArray, end: object, reach_m: float) -> int:
    """Return the first point of an arc that lies beyond the access point."""
    if not isinstance(end, Mouth):
        return 0
    beyond = np.asarray((points_m[:, :2] - end.middle_m) @ end.axis.along) > reach_m + 0.3
    return int(np.argmax(beyond)) if beyond.any() else len(points_m) - 1


def _access(mouth: Mouth, reach_m: float, z_m: float) -> FloatArray:
    """Return the tunnel's access point (4,): its heading leads into the junction."""
    place = mouth.middle_m + reach_m * mouth.axis.along
    return np.array([*place, z_m, math.remainder(mouth.axis.heading_rad + math.pi, 2.0 * math.pi)])


def outline_of(graph: Graph, middle_m: FloatArray, access: list[FloatArray]) -> FloatArray:
    """Return the free space (N, 2) of an intersection: what lies around its middle within its access points."""
    sheet, free = graph.sheet, graph.room.free
    if not access:
        return np.zeros((0, 2))
    reach = max(math.dist(pose[:2], middle_m) for pose in access) + 6.0
    corner = np.maximum(sheet.at(middle_m[None] - reach)[0], 0)
    patch = free[
        corner[0] : corner[0] + int(2 * reach / sheet.cell_m), corner[1] : corner[1] + int(2 * reach / sheet.cell_m)
    ]
    rows, columns = np.nonzero(patch)
    points = sheet.middles_m(np.column_stack([rows, columns]) + corner)
    inside = np.ones(len(points), bool)
    for pose in access:  # nothing beyond the line across each access point
        inward = np.array([math.cos(pose[3]), math.sin(pose[3])])
        beyond = (points - pose[:2]) @ inward < -_OUTLINE_SLACK_M
        sideways = np.abs((points - pose[:2]) @ np.array([-inward[1], inward[0]]))
        inside &= ~(beyond & (sideways < 8.0))
    mask = np.zeros(patch.shape, np.uint8)
    mask[rows[inside], columns[inside]] = 1
    seed = sheet.at(middle_m[None])[0] - corner
    count, labels = cv2.connectedComponents(mask, connectivity=4)
    labels = np.asarray(labels)
    if count < 2 or not ((seed >= 0) & (seed < np.array(labels.shape))).all():
        return np.zeros((0, 2))
    label = int(labels[seed[0], seed[1]]) or int(np.bincount(labels[labels > 0]).argmax())
    contours, _ = cv2.findContours((labels == label).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    simplified = cv2.approxPolyDP(max(contours, key=cv2.contourArea), 0.75, closed=True)
    ring: npt.NDArray[np.int64] = np.array(simplified, dtype=np.int64)
    return sheet.middles_m(ring.reshape(-1, 2)[:, ::-1] + corner)


def grade_pct(line_m: FloatArray) -> float:
    """Return the steepest grade of a line (N, 3) over ten metres, in percent."""
    along = arc_m(line_m[:, :2])
    if along[-1] < 2.0:
        return 0.0
    smooth = gaussian_filter1d(line_m[:, 2], 3.0, mode="nearest")
    ahead = np.interp(along + _GRADE_M, along, smooth)
    span = np.minimum(along + _GRADE_M, along[-1]) - along
    valid = span >= min(_GRADE_M, along[-1]) * 0.9
    grades = 100.0 * (ahead[valid] - smooth[valid]) / np.maximum(span[valid], 1e-6)
    return float(np.abs(grades).max(initial=0.0))
