"""The topological map: nodes (tunnels, intersections), their access points and waypoints, and the connections within a node.

As in the topological paper, Section 3.2: a tunnel is a single path between two ends, an intersection joins three or more arms.
Both have access points, which face outward; two nodes meet where an access point `joins` its twin, at one place, facing the
other way. It is a multigraph: several tunnels may join the same two intersections, and one may end where it began. Poses are
(4,): x, y, z (m) and yaw (rad) in `map`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from lhdmap.messages import FloatArray

DEAD_END, UNEXPLORED = "dead_end", "unexplored"
Preference = Literal["centre", "left", "right"]
Purpose = Literal["draw_point", "dump", "park", "turning_bay", "passing_bay", "pass", "stop"]
Kind = Literal["front_front", "front_back", "back_front", "back_back"]
PREFERENCES: tuple[Preference, ...] = ("centre", "left", "right")
PURPOSES: tuple[Purpose, ...] = ("draw_point", "dump", "park", "turning_bay", "passing_bay", "pass", "stop")
KINDS: tuple[Kind, ...] = ("front_front", "front_back", "back_front", "back_back")


@dataclass(frozen=True, slots=True)
class Tunnel:
    """A way between two ends, each an intersection's id, `dead_end` or `unexplored`.

    `line_m` (N, 3): the centre line from the first end to the second, between the access points. `half_widths_m` (N, 2): free
    room to its left and right. `pose_map_node` (4,): the node's frame, at the line's start, x along it. `driven`: whether the
    machine was in it, or has only seen it. `not_distinctive_m`: stretches [from, to] whose walls do not tell where one is.
    """

    id: str
    name: str
    ends: tuple[str, str]
    line_m: FloatArray
    half_widths_m: FloatArray
    pose_map_node: FloatArray
    driven: bool = True
    closed: bool = False
    speed_limit_kmh: float = 12.0
    wall_preference: Preference = "centre"
    grade_max_pct: float = 0.0
    not_distinctive_m: tuple[tuple[float, float], ...] = ()

    @property
    def length_m(self) -> float:
        """Length of the centre line."""
        return float(np.linalg.norm(np.diff(self.line_m, axis=0), axis=1).sum())

    @property
    def widths_m(self) -> FloatArray:
        """Free widths (N,) along the line."""
        widths: FloatArray = self.half_widths_m.sum(axis=1)
        return widths


@dataclass(frozen=True, slots=True)
class Intersection:
    """A place with three or more arms: `degree` of them. `outline_m` (N, 2): its free space; `pose_map_node` (4,) its frame.

    `level`: number or name of the mine's level that it is on.
    """

    id: str
    name: str
    degree: int
    pose_map_node: FloatArray
    outline_m: FloatArray
    level: str | int = 0


@dataclass(frozen=True, slots=True)
class AccessPoint:
    """Where a node ends: pose (4,) in `map`, heading outward; `joins` is the twin in the neighbour, None at a dead end."""

    id: str
    node: str
    pose: FloatArray
    joins: str | None = None


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A pose (4,) within a node that something is done at; its heading is the node's direction."""

    id: str
    name: str
    node: str
    pose: FloatArray
    purpose: Purpose = "pass"
    speed_limit_kmh: float = 12.0


@dataclass(frozen=True, slots=True)
class Connection:
    """A way within one node, both ways drivable, between two of its points (ids): leaves the first one by its front or back.

    `kind` says so: `front_back` leaves `start` by its front and comes to `end` from behind. `line_m` (N, 3): the path of
    `base_link` with the least radius `min_radius_m` (m, inf if straight); `clearance_m`: least room beside both bodies.
    `feasible`: whether the machine can drive it at all; `closed`: an operator has closed it.
    """

    start: str
    end: str
    kind: Kind
    line_m: FloatArray
    length_m: float
    min_radius_m: float = math.inf
    clearance_m: float = math.inf
    speed_limit_kmh: float = 12.0
    feasible: bool = True
    closed: bool = False
    reason: str = ""


Point = AccessPoint | Waypoint


@dataclass(frozen=True)
class TopologicalMap:
    """All of it, in the order in which it was found. `registration`: the mine's grid, as `lhdmap export` writes it, or None."""

    tunnels: tuple[Tunnel, ...] = ()
    intersections: tuple[Intersection, ...] = ()
    access_points: tuple[AccessPoint, ...] = ()
    waypoints: tuple[Waypoint, ...] = ()
    connections: tuple[Connection, ...] = ()
    version: int = 1
    frame: str = "map"
    registration: Mapping[str, Any] | None = None
    remarks: tuple[str, ...] = field(default=())

    @cached_property
    def points(self) -> dict[str, Point]:
        """Access points and waypoints by id."""
        points: list[Point] = [*self.access_points, *self.waypoints]
        return {point.id: point for point in points}

    @cached_property
    def nodes(self) -> dict[str, Tunnel | Intersection]:
        """Tunnels and intersections by id."""
        nodes: list[Tunnel | Intersection] = [*self.tunnels, *self.intersections]
        return {node.id: node for node in nodes}

    def points_of(self, node: str) -> list[Point]:
        """Return the points of a node (id)."""
        return [point for point in self.points.values() if point.node == node]

    def called(self, name: str) -> Tunnel | Intersection | Point | None:
        """Return what has this id or name: ids first, then waypoints, then nodes; None where nothing has."""
        found = self.points.get(name) or self.nodes.get(name)
        return found or next((one for one in self._named() if one.name == name), None)

    def names(self) -> list[str]:
        """Return all names and ids that something may be asked for by."""
        return list(dict.fromkeys([*(one.name for one in self._named()), *self.points, *self.nodes]))

    def _named(self) -> Iterable[Waypoint | Tunnel | Intersection]:
        return (*self.waypoints, *self.tunnels, *self.intersections)
