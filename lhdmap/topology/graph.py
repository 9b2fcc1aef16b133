"""Junctions and the lines between them on one sheet: the skeleton with the free space around it, and what depends on the scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter

from lhdmap.messages import FloatArray
from lhdmap.topology.arms import Axis, axis_of, fitted, meeting_m, through, unit
from lhdmap.topology.collinear import COLLINEAR, LONG_M, axis_of_parts, direction_of, fitted_part, inner_part
from lhdmap.topology.driven import DrivenShare, arc_m, driven_shares
from lhdmap.topology.free_space import filled
from lhdmap.topology.room import Room
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.sheet import OCCUPIED, UNKNOWN, Sheet
from lhdmap.topology.skeleton import Line, Skeleton, Vertex, band_of, core_of, skeleton_of

PAPER_WIDTH_M = 2.45
_BUILDING_OBSTACLE_M = 1.0
_RIDGE_M = 1.5
_FILLS = 0.35  # of the tunnels' width: a machine that wide is in a mine, where openings count that were only seen
_LINE_DRIVEN = 0.5
_AT_CUT_M = 6.0
_SHORT_M, _STRAIGHT = 6.0, 1.15
_TAIL_M = 6.0  # of a line, that tell how it goes on


class Scale(NamedTuple):
    """What depends on the machine and the tunnels: median width, radius of the core, depth of an opening, size of obstacles.

    `machine_m`: the machine's width; `seen`: whether openings count that were only seen.
    """

    tunnel_m: float
    core_m: float
    opening_m: float
    obstacle_m: float
    machine_m: float
    seen: bool


@dataclass(slots=True)
class Niche:
    """An arm too short to be an opening: where it leaves (2,), and how deep it is."""

    point_m: FloatArray
    depth_m: float


class _Kept(NamedTuple):
    """Axes of a vertex at a place, and the lines and far free radii that they were made from."""

    place: Vertex
    lines: list[Line]
    far_m: list[float]
    axes: list[Axis]


@dataclass(slots=True)
class Graph:
    """Junctions and lines of a sheet, along a drive at `driven_m` (N, 2).

    `cuts_m` (K, 2): where the drive goes on in another sheet; a line that ends there is no dead end.
    """

    sheet: Sheet
    room: Room
    scale: Scale
    skeleton: Skeleton
    driven_m: FloatArray
    cuts_m: FloatArray
    niches: list[Niche] = field(default_factory=list)
    _kept: dict[int, _Kept] = field(default_factory=dict, repr=False)

    @property
    def driven_share(self) -> float:
        """Share of a line from which on it counts as driven."""
        return _LINE_DRIVEN

    def shares(self) -> list[DrivenShare]:
        """Return what of each line was driven."""
        return driven_shares(self.skeleton, self.driven_m)

    def goes_on(self, vertex: int) -> bool:
        """Return whether a line's end is where the drive goes on in another sheet: of all ends the one next to the cut."""
        for cut_m in self.cuts_m:
            ends = [one for one in self.skeleton.vertices if self.skeleton.degree(one) == 1]
            apart = [float(np.linalg.norm(self.skeleton.vertices[one].point_m - cut_m)) for one in ends]
            if ends and min(apart) < _AT_CUT_M and ends[int(np.argmin(apart))] == vertex:
                return True
        return False

    def junctions(self) -> list[int]:
        """Return the vertices with three or more arms."""
        return [vertex for vertex in self.skeleton.vertices if self.skeleton.degree(vertex) > 2]

    def lines_at(self, vertex: int) -> list[Line]:
        """Return the lines at a vertex; one that begins and ends there is in it twice."""
        return self.skeleton.at(vertex)

    def arms(self, vertex: int) -> list[Line]:
        """Return the lines at a vertex, each leaving it, in the order of `lines_at`."""
        lines = self.skeleton.lines
        starts = [line for line in lines if line.start == vertex]
        return starts + [line.reversed() for line in lines if line.end == vertex]

    def axes(self, vertex: int) -> tuple[FloatArray, list[Axis]]:
        """Return the middle of a junction (2,) and its arms' axes, in the order of `arms`."""
        centre, radius = self.skeleton.vertices[vertex]
        arms, own = self.arms(vertex), self._own_axes(vertex)
        axes = [self._with_more(arm, k, arms, own) for k, arm in enumerate(arms)]
        middle = meeting_m(axes, centre, radius)
        for k, (arm, axis) in enumerate(zip(arms, axes, strict=True)):
            if self._ends_soon(arm, axis):
                axes[k] = through(axis, middle, self._middle(arm.end))
        return middle, axes

    def _ends_soon(self, arm: Line, axis: Axis) -> bool:
        """Return whether an arm with little wall of its own goes straight to another junction."""
        if axis.fitted_m >= _SHORT_M or arm.end == arm.start or self.skeleton.degree(arm.end) < 3:
            return False
        chord = float(np.linalg.norm(arm.points_m[-1] - arm.points_m[0]))
        return axis.fitted_m == 0.0 or arm.length_m < _STRAIGHT * chord

    def _own_axes(self, vertex: int) -> list[Axis]:
        """Return the axes of a junction's arms, each by itself; kept as long as its lines are what they were."""
        place, arms, lines = self.skeleton.vertices[vertex], self.arms(vertex), self.lines_at(vertex)
        far = [self._far_radius_m(arm) for arm in arms]
        kept = self._kept.get(vertex)
        if kept is not None and kept.place is place and kept.far_m == far and _same(kept.lines, lines):
            return list(kept.axes)
        axes = [axis_of(arm, *place, self.room, far_m) for arm, far_m in zip(arms, far, strict=True)]
        self._kept[vertex] = _Kept(place, lines, far, axes)
        return list(axes)

    def _middle(self, vertex: int) -> FloatArray:
        return meeting_m(self._own_axes(vertex), *self.skeleton.vertices[vertex])

    def _far_radius_m(self, arm: Line) -> float:
        return self.skeleton.vertices[arm.end].radius_m if self.skeleton.degree(arm.end) > 2 else 0.0

    def _with_more(self, arm: Line, number: int, arms: list[Line], own: list[Axis]) -> Axis:
        """Return the axis of an arm; a short one is fitted together with those that go on beyond either of its ends."""
        if own[number].fitted_m >= LONG_M:
            return own[number]
        centre, radius = self.skeleton.vertices[arm.start]
        chord = direction_of(arm, centre, radius)
        parts = [inner_part(arm, centre, radius, self._far_radius_m(arm))]
        others = [(one, axis, -1.0) for k, (one, axis) in enumerate(zip(arms, own, strict=True)) if k != number]
        if arm.end != arm.start and self.skeleton.degree(arm.end) > 2:
            others += [
                (one, axis, 1.0)
                for one, axis in zip(self.arms(arm.end), self._own_axes(arm.end), strict=True)
                if one.end != arm.start
            ]
        for one, axis, sign in others:
            if sign * float(axis.along @ chord) > COLLINEAR and axis.fitted_m > 0.0:
                parts.append(fitted_part(one, *self.skeleton.vertices[one.start], self._far_radius_m(one)))
        return axis_of_parts(own[number], chord, parts, self.room) if len(parts) > 1 else own[number]


def _same(some: list[Line], others: list[Line]) -> bool:
    return len(some) == len(others) and all(a is b for a, b in zip(some, others, strict=True))


def whole_graph(sheet: Sheet, driven_m: FloatArray, scale: Scale, cuts: Sequence[FloatArray] = ()) -> Graph:
    """Return the skeleton of a sheet along a drive at `driven_m` (N, 2), with all its spurs; `cuts`: poses (4,) of cuts."""
    was_there = band_of(sheet, driven_m, scale.machine_m)  # far ahead in a drift beams do not come back
    room = Room(filled(sheet.cells, sheet.cell_m, scale.obstacle_m) | (was_there & (sheet.cells == UNKNOWN)), sheet)
    core, distance_m = core_of(room.free, sheet, driven_m, scale.core_m, [barrier_m(room, cut) for cut in cuts])
    cuts_m = np.array([cut[:2] for cut in cuts]).reshape(-1, 2)
    return Graph(sheet, room, scale, skeleton_of(core, distance_m, sheet), driven_m, cuts_m)


def scale_of(sheet: Sheet, driven_m: FloatArray, machine_m: float | None, settings: TopologySettings) -> Scale:
    """Return the lengths that go with machine and tunnels.

    A machine that nobody described, and that would not fit, is taken to be as wide as robots are in corridors.
    """
    import cv2

    free = filled(sheet.cells, sheet.cell_m, _BUILDING_OBSTACLE_M)
    distance = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * sheet.cell_m
    ridge = maximum_filter(distance, size=2 * int(_RIDGE_M / sheet.cell_m) + 1)
    cells = sheet.at(driven_m)
    tunnel = 2.0 * float(np.median(ridge[cells[:, 0], cells[:, 1]]))
    machine = PAPER_WIDTH_M if machine_m is None else machine_m
    if machine_m is None and tunnel < 1.3 * machine:
        machine = 0.3 * tunnel
    seen = settings.arms == "seen" or (settings.arms == "auto" and machine > _FILLS * tunnel)
    return Scale(
        tunnel,
        min(settings.radius_machine * machine, settings.radius_tunnel * tunnel),
        min(settings.opening_m, settings.opening_machine * machine),
        settings.obstacle_m if seen else _BUILDING_OBSTACLE_M,
        machine,
        seen,
    )


def barrier_m(room: Room, cut: FloatArray) -> FloatArray:
    """Return the line (2, 2) from wall to wall across a tunnel at a pose (4,)."""
    left = np.array([-math.sin(cut[3]), math.cos(cut[3])])
    sides = np.array([left, -left])
    reach = room.to_wall_m(np.repeat(cut[None, :2], 2, axis=0), sides, 10.0)
    ends: FloatArray = cut[:2] + sides * (reach + 2.0 * room.sheet.cell_m)[:, None]
    return ends


def end_of(arm: Line, scale: Scale) -> tuple[FloatArray, FloatArray, float]:
    """Return where a dead end's line is still in the middle (2,), its direction there (2,), and its length up to there (m).

    Before the face it turns into a corner.
    """
    along = arc_m(arm.points_m)
    last = float(along[-1]) - min(0.5 * scale.tunnel_m, 0.3 * float(along[-1]))
    kept = arm.points_m[along <= last]
    tail = kept[along[: len(kept)] >= last - _TAIL_M]
    if len(tail) < 3:
        return kept[-1], unit(arm.points_m[-1] - arm.points_m[0]), last
    return kept[-1], fitted(tail, tail[-1] - tail[0])[0], last


def closed_share(graph: Graph, line: Line, vertex: int) -> float:
    """Return the share of the view ahead of a line's end at `vertex` that ends at walls, and not in the unknown."""
    leaving = line.leaving(vertex).reversed() if line.start == vertex else line
    end, direction, _ = end_of(leaving, graph.scale)
    heading = math.atan2(direction[1], direction[0])
    angles = heading + np.radians(np.arange(-45.0, 46.0, 5.0))
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    far = graph.room.to_wall_m(np.repeat(end[None], len(rays), axis=0), rays)
    tips = end + rays * (far + 0.6 * graph.sheet.cell_m)[:, None]
    return float(_is_wall(graph.sheet, tips).mean())


def _is_wall(sheet: Sheet, points_m: FloatArray) -> npt.NDArray[np.bool_]:
    """Return whether a wall is within a cell of points (N, 2)."""
    cells = sheet.at(points_m)
    found = np.zeros(len(points_m), bool)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            near = cells + np.array([row, column])
            inside = ((near >= 0) & (near < sheet.cells.shape)).all(axis=1)
            found[inside] |= sheet.cells[near[inside, 0], near[inside, 1]] == OCCUPIED
    return found
