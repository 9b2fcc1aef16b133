"""Arcs: the lines between junctions as centre lines in space, with the room to both sides; those of several sheets joined.

A centre line is the middle between both walls, taken each metre across the skeleton's direction and smoothed over some metres: the
skeleton itself swerves into each niche.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, percentile_filter
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.arms import Axis, reach_m
from lhdmap.topology.driven import arc_m
from lhdmap.topology.graph import Graph, closed_share, end_of
from lhdmap.topology.levels import Cut
from lhdmap.topology.model import DEAD_END, UNEXPLORED
from lhdmap.topology.room import Room
from lhdmap.topology.skeleton import Line

STEP_M = 1.0
SEVERAL = -1
"""The sheet of an arc that goes over more than one."""
_SMOOTH_STEPS = 2.0
_ROUNDS = 3
_WALL_PERCENT, _WALL_STEPS = 35, 11  # of the room over some metres: niches are no part of it
_WIDEST_M = 8.0  # to one side: beyond is a room or a branch
_CLOSED = 0.7
_AT_CUT_M = 6.0
_SMOOTH_HEIGHT = 4.0


class Mouth(NamedTuple):
    """Where an arc leaves a junction (sheet, vertex): its middle (2,), the arm's axis, and where along that the junction ends."""

    junction: tuple[int, int]
    middle_m: FloatArray
    axis: Axis
    reach_m: float


End = Mouth | str
"""A junction's mouth, or `dead_end`, `unexplored`, `cut K`."""


@dataclass(slots=True)
class Arc:
    """A line between two ends: points (N, 3) each metre, room (N, 2) left and right, its sheet, whether it was driven."""

    ends: tuple[End, End]
    points_m: FloatArray
    room_m: FloatArray
    sheet: int
    driven: bool

    def reversed(self) -> Arc:
        """Return the arc from its end to its start."""
        ends = (self.ends[1], self.ends[0])
        return Arc(ends, self.points_m[::-1], self.room_m[::-1, ::-1], self.sheet, self.driven)

    def ends_at(self, name: str) -> bool:
        """Return whether one of its ends has this name."""
        return any(isinstance(end, str) and end == name for end in self.ends)


def arcs_of(graph: Graph, sheet: int, heights: Heights, cuts: list[Cut]) -> list[Arc]:
    """Return the arcs of a sheet; `cuts`: where the drive goes on in another one."""
    shares, mouths = graph.shares(), mouths_of(graph, sheet)
    return [
        _arc(graph, sheet, line, heights, (cuts, mouths), driven=share.share >= graph.driven_share)
        for line, share in zip(graph.skeleton.lines, shares, strict=True)
    ]


def mouths_of(graph: Graph, sheet: int) -> dict[tuple[int, bool], Mouth]:
    """Return the mouth of each line (by its identity) at its start (True) and at its end (False), where a junction is there."""
    found: dict[tuple[int, bool], Mouth] = {}
    for vertex in graph.junctions():
        middle, axes = graph.axes(vertex)
        lines = graph.lines_at(vertex)
        starts = sum(line.start == vertex for line in graph.skeleton.lines)
        for k, (line, axis) in enumerate(zip(lines, axes, strict=True)):
            reach = reach_m(axis, axes[:k] + axes[k + 1 :], middle, graph.room)
            found[id(line), k < starts] = Mouth((sheet, vertex), middle, axis, reach)
    return found


class Heights:
    """Height of the floor near the drive: that of the nearest pose (N, 4) of its sheet."""

    def __init__(self, poses: FloatArray) -> None:
        self._tree, self._heights = KDTree(poses[:, :2]), poses[:, 2]

    def at(self, points_m: FloatArray) -> FloatArray:
        """Return the heights (N,) at points (N, 2)."""
        apart, near = self._tree.query(points_m, k=min(4, self._tree.n))
        weights = 1.0 / (np.atleast_2d(apart.T).T + 0.5)
        heights = self._heights[np.atleast_2d(near.T).T]
        found: FloatArray = (weights * heights).sum(axis=1) / weights.sum(axis=1)
        return found


def centred(points_m: FloatArray, room: Room) -> tuple[FloatArray, FloatArray]:
    """Return the middle line of a tunnel along points (N, 2), each metre, and the room (N, 2) to its left and right."""
    line = resampled(points_m, STEP_M)
    for _ in range(_ROUNDS):
        if len(line) < 3:
            break
        normals = normals_of(line)
        left, right = room.to_wall_m(line, normals, _WIDEST_M), room.to_wall_m(line, -normals, _WIDEST_M)
        walled = (left < _WIDEST_M) & (right < _WIDEST_M)
        left, right = (percentile_filter(side, _WALL_PERCENT, _WALL_STEPS, mode="nearest") for side in (left, right))
        shift = np.where(walled, 0.5 * (left - right), 0.0)
        moved = line + np.clip(shift, -2.0, 2.0)[:, None] * normals
        moved = gaussian_filter1d(moved, _SMOOTH_STEPS, axis=0, mode="nearest")
        moved[[0, -1]] = line[[0, -1]]
        line = resampled(moved, STEP_M)
    normals = normals_of(line)
    return line, np.column_stack([room.to_wall_m(line, normals, _WIDEST_M), room.to_wall_m(line, -normals, _WIDEST_M)])


def resampled(points_m: FloatArray, step_m: float) -> FloatArray:
    """Return points (M, D) along points (N, D), the ends kept, each about `step_m`; two at least."""
    along = arc_m(points_m)
    wanted = np.linspace(0.0, along[-1], max(round(along[-1] / step_m), 1) + 1)
    out: FloatArray = np.column_stack([np.interp(wanted, along, column) for column in points_m.T])
    return out


def normals_of(line_m: FloatArray) -> FloatArray:
    """Return the unit normals (N, 2) to the left of a line (N, 2 or more)."""
    way = np.gradient(line_m[:, :2], axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    normals: FloatArray = np.column_stack([-way[:, 1], way[:, 0]])
    return normals


_Ends = tuple[list[Cut], dict[tuple[int, bool], Mouth]]


def _arc(graph: Graph, sheet: int, line: Line, heights: Heights, known: _Ends, *, driven: bool) -> Arc:
    points = _to_the_wall(graph, line)
    middle, room = centred(points, graph.room)
    z = _smoothed(heights.at(middle))
    ends = _end(graph, sheet, line, known, at_start=True), _end(graph, sheet, line, known, at_start=False)
    return Arc(ends, np.column_stack([middle, z]), room, sheet, driven)


def _smoothed(heights_m: FloatArray) -> FloatArray:
    """Return heights (N,) smoothed along a line; grades go on beyond its ends, where other arcs are joined."""
    more = min(round(4.0 * _SMOOTH_HEIGHT), len(heights_m) - 1)
    padded = np.pad(heights_m, more, mode="reflect", reflect_type="odd")
    smooth: FloatArray = gaussian_filter1d(padded, _SMOOTH_HEIGHT, mode="nearest")
    return smooth[more : len(padded) - more]


def _to_the_wall(graph: Graph, line: Line) -> FloatArray:
    """Return the points of a line, dead ends prolonged to the wall: the core ends its radius before it."""
    points = line.points_m
    for vertex, at_end in ((line.start, False), (line.end, True)):
        if graph.skeleton.degree(vertex) != 1:
            continue
        arm = line if at_end else line.reversed()
        end, direction, length = end_of(arm, graph.scale)
        outward = points if at_end else points[::-1]
        more = min(float(graph.room.to_wall_m(end[None], direction[None])[0]), 3.0 * graph.scale.tunnel_m)
        kept = len(outward) - np.count_nonzero(arc_m(arm.points_m) > length)
        outward = outward[:kept]
        if not graph.goes_on(vertex):  # else it goes on in another sheet, and is joined there
            outward = np.vstack([outward, end + more * direction])
        points = outward if at_end else outward[::-1]
    return points


def _end(graph: Graph, sheet: int, line: Line, known: _Ends, *, at_start: bool) -> End:
    cuts, mouths = known
    mouth = mouths.get((id(line), at_start))
    if mouth is not None:
        return mouth
    vertex = line.start if at_start else line.end
    point = graph.skeleton.vertices[vertex].point_m
    for number, cut in enumerate(cuts):
        if sheet in (cut.lower, cut.lower + 1) and float(np.linalg.norm(cut.pose[:2] - point)) < _AT_CUT_M:
            return f"cut {number}"
    if graph.skeleton.degree(vertex) > 1:  # a ring without a junction
        return UNEXPLORED
    return DEAD_END if closed_share(graph, line, vertex) >= _CLOSED else UNEXPLORED


def joined(arcs: list[Arc], cuts: list[Cut]) -> list[Arc]:
    """Return the arcs with those that meet at a cut made one."""
    arcs = list(arcs)
    for number, cut in enumerate(cuts):
        name = f"cut {number}"
        parts = [arc for arc in arcs if arc.ends_at(name)]
        lower = [arc for arc in parts if arc.sheet == cut.lower]
        upper = [arc for arc in parts if arc.sheet == cut.lower + 1]
        if not lower or not upper or lower[0] is upper[0]:
            continue
        first = lower[0] if _is(lower[0].ends[1], name) else lower[0].reversed()
        second = upper[0] if _is(upper[0].ends[0], name) else upper[0].reversed()
        arcs = [arc for arc in arcs if arc is not lower[0] and arc is not upper[0]]
        arcs.append(_one(first, second, cut))
    return [_without_cut(arc) for arc in arcs]


def _is(end: End, name: str) -> bool:
    return isinstance(end, str) and end == name


def _one(first: Arc, second: Arc, cut: Cut) -> Arc:
    """Return two arcs as one; near the cut, where the core ended before it, the points run straight."""
    a, b = _up_to(first, cut), _up_to(second.reversed(), cut).reversed()
    points = np.vstack([a.points_m, cut.pose[None, :3], b.points_m])
    room = np.vstack([a.room_m, 0.5 * (a.room_m[-1:] + b.room_m[:1]), b.room_m])
    along = arc_m(points)
    wanted = np.linspace(0.0, along[-1], max(round(along[-1] / STEP_M), 1) + 1)
    points = np.column_stack([np.interp(wanted, along, column) for column in points.T])
    room = np.column_stack([np.interp(wanted, along, column) for column in room.T])
    return Arc((first.ends[0], second.ends[1]), points, room, SEVERAL, first.driven or second.driven)


def _up_to(arc: Arc, cut: Cut) -> Arc:
    """Return an arc without its last points beyond or near a cut."""
    heading = cut.pose[3]
    ahead = np.array([math.cos(heading), math.sin(heading)])
    along = (arc.points_m[:, :2] - cut.pose[:2]) @ ahead
    side = math.copysign(1.0, float(np.median(along[-min(len(along), 15) : -2] if len(along) > 4 else along)))
    keep = (along * side > 1.0) | (np.arange(len(along)) < max(len(along) - 12, 2))
    return Arc(arc.ends, arc.points_m[keep], arc.room_m[keep], arc.sheet, arc.driven)


def _without_cut(arc: Arc) -> Arc:
    ends = [UNEXPLORED if isinstance(end, str) and end.startswith("cut") else end for end in arc.ends]
    arc.ends = (ends[0], ends[1])
    return arc
