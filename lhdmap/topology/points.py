"""Waypoints of tunnels, and the connections between the points of each node."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.topology.connections import Drivable, Walls, connection, drivable, way_between
from lhdmap.topology.driven import arc_m
from lhdmap.topology.model import (
    DEAD_END,
    AccessPoint,
    Connection,
    Kind,
    Point,
    Purpose,
    TopologicalMap,
    Tunnel,
    Waypoint,
)
from lhdmap.topology.names import Names, Place, purpose_of
from lhdmap.topology.settings import TopologySettings

_PILE_M = 15.0  # from a waypoint to the pile's middle: the machine's front and the pile itself
_ENDS_M = 3.0  # a place so near the farthest pose of a dead end is that end's
_STOOD_S = 3.0
_APART_M = 1.5
_SHORT_M = 8.0  # a tunnel so short has no line of its own: the machine goes from point to point


def waypoints_of(
    topology: TopologicalMap,
    names: Names,
    where: npt.NDArray[np.int64],
    path: FloatArray,
    path_ns: npt.NDArray[np.int64],
    settings: TopologySettings,
) -> list[Waypoint]:
    """Return a waypoint for each driven dead end, where the machine came farthest, and for each place that was named."""
    found: list[Waypoint] = []
    for number, tunnel in enumerate(topology.tunnels):
        rows = np.flatnonzero(where == number)
        places = [place for place in names.places if place.tunnel == number]
        ended = _dead_end(tunnel, places, path, rows)
        if ended is not None:
            at_m, name = ended
            found.append(_waypoint(len(found) + 1, name, tunnel, at_m, settings))
            places = [place for place in places if place.name != name]
        for place in places:
            at_m = _stood_at(tunnel, place, path, path_ns)
            found.append(_waypoint(len(found) + 1, place.name, tunnel, at_m, settings))
    return _named_apart(found)


def _named_apart(waypoints: list[Waypoint]) -> list[Waypoint]:
    """Return the waypoints, generated names numbered past those that are taken: names of before stay when a map grows."""
    said = {one.name for one in waypoints if one.name != one.id.upper()}
    free = (f"W{number}" for number in itertools.count(1) if f"W{number}" not in said)
    return [replace(one, name=next(free)) if one.name == one.id.upper() else one for one in waypoints]


def _dead_end(
    tunnel: Tunnel, places: list[Place], path: FloatArray, rows: npt.NDArray[np.int64]
) -> tuple[float, str] | None:
    """Return where in a driven dead end the machine came farthest (m along the line), and the name of that place."""
    if tunnel.ends[1] != DEAD_END or not tunnel.driven or not len(rows):
        return None
    at = along_m(tunnel, path[rows])
    farthest = float(at.max())
    last = rows[int(at.argmax())]
    there = [place for place in places if len(place.rows) and np.abs(place.rows - last).min() * 0.25 <= _ENDS_M]
    said = there[0].name if there else (tunnel.name if purpose_of(tunnel.name) else "")
    return farthest, said


def _stood_at(tunnel: Tunnel, place: Place, path: FloatArray, path_ns: npt.NDArray[np.int64]) -> float:
    """Return where in a place the machine stood longest, or its drive began or ended (m along its tunnel), else its middle."""
    at = along_m(tunnel, path[place.rows])
    if len(place.rows) > 1:
        waits_s = np.diff(path_ns[place.rows]) * 1e-9
        longest = int(waits_s.argmax())
        if waits_s[longest] > _STOOD_S and place.rows[longest + 1] == place.rows[longest] + 1:
            return float(at[longest])
    ends = np.flatnonzero((place.rows == 0) | (place.rows == len(path) - 1))
    if len(ends):
        return float(at[ends[0]])
    return 0.5 * float(at.min() + at.max())


def along_m(tunnel: Tunnel, points_m: FloatArray) -> FloatArray:
    """Return where along a tunnel's line points (N, 2 or more) are, shape (N,), metres."""
    along, line = arc_m(tunnel.line_m), tunnel.line_m[:, :2]
    near = np.linalg.norm(points_m[:, None, :2] - line[None], axis=2).argmin(axis=1)
    tangent = np.gradient(line, axis=0) if len(line) > 1 else np.zeros_like(line)
    length = np.maximum(np.hypot(*tangent.T), 1e-9)
    beyond = ((points_m[:, :2] - line[near]) * tangent[near]).sum(axis=1) / length[near]
    half = 0.5 * length[near]  # no farther than half-way to the next point of the line
    found: FloatArray = np.clip(along[near] + np.clip(beyond, -half, half), 0.0, along[-1])
    return found


def pose_at(tunnel: Tunnel, at_m: float) -> FloatArray:
    """Return the pose (4,) on a tunnel's line, heading along it."""
    along = arc_m(tunnel.line_m)
    place = [float(np.interp(at_m, along, column)) for column in tunnel.line_m.T]
    ahead = [np.interp([at_m - 2.0, at_m + 2.0], along, column) for column in tunnel.line_m.T[:2]]
    return np.array([*place, math.atan2(ahead[1][1] - ahead[1][0], ahead[0][1] - ahead[0][0])])


def with_piles(topology: TopologicalMap, piles_m: Sequence[FloatArray]) -> TopologicalMap:
    """Return the map with the waypoints before piles (middles, (3,)) as draw points, where no name says what they are."""

    def judged(one: Waypoint) -> Waypoint:
        before = one.purpose == "stop" and any(math.dist(pile[:2], one.pose[:2]) < _PILE_M for pile in piles_m)
        return replace(one, purpose="draw_point") if before else one

    return replace(topology, waypoints=tuple(map(judged, topology.waypoints)))


def _waypoint(number: int, name: str, tunnel: Tunnel, at_m: float, settings: TopologySettings) -> Waypoint:
    pose = pose_at(tunnel, at_m)
    purpose: Purpose = purpose_of(name) or "stop"
    return Waypoint(f"w{number}", name or f"W{number}", tunnel.id, pose, purpose, settings.speed_limit_kmh)


def connections_of(
    topology: TopologicalMap,
    walls: Mapping[str, Walls | None],
    driven: Collection[tuple[str, str]],
    machine: Machine,
    settings: TopologySettings,
) -> list[Connection]:
    """Return the connections within each node: along a tunnel from point to point, through an intersection from arm to arm.

    `walls` of each node's sheet (None: it is on several); `driven`: pairs of access points that the machine has gone between.
    """
    body = drivable(machine)
    found: list[Connection] = []
    for tunnel in topology.tunnels:
        found += _along(topology, tunnel, walls[tunnel.id], body)
    for node in topology.intersections:
        points = topology.points_of(node.id)
        for a, b in itertools.combinations(points, 2):
            way = way_between(_inward(a), b.pose)
            chord = np.vstack([a.pose[:3], b.pose[:3]])
            names: tuple[str, str, Kind] = (a.id, b.id, "back_back")
            one = connection(names, way, chord, walls[node.id], body, settings.speed_limit_kmh)
            was_driven = (a.id, b.id) in driven or (b.id, a.id) in driven
            found.append(replace(one, feasible=True, reason="") if was_driven else one)
    return found


def _inward(point: Point) -> FloatArray:
    """Return an access point's pose, turned into its node."""
    pose: FloatArray = point.pose + np.array([0.0, 0.0, 0.0, math.pi])
    return pose


def driven_pairs(topology: TopologicalMap, where: npt.NDArray[np.int64]) -> set[tuple[str, str]]:
    """Return the pairs of access points of intersections that a drive went between; `where` (M) as `names.whereabouts`.

    What was driven can be driven, whatever a way that nobody drove comes to.
    """
    changes = np.flatnonzero(np.diff(where)) + 1
    nodes = [int(where[0]), *where[changes].tolist()]
    found = set()
    for before, node, after in zip(nodes, nodes[1:], nodes[2:], strict=False):
        if node >= 0 or before < 0 or after < 0 or before == after:
            continue
        own = topology.points_of(topology.intersections[-1 - node].id)
        arms = [[p.id for p in own if f".t{tunnel + 1}." in p.id] for tunnel in (before, after)]
        if len(arms[0]) == len(arms[1]) == 1:
            found.add((arms[0][0], arms[1][0]))
    return found


def _along(topology: TopologicalMap, tunnel: Tunnel, walls: Walls | None, body: Drivable) -> list[Connection]:
    points = topology.points_of(tunnel.id)
    along = arc_m(tunnel.line_m)
    places = sorted(((_place(tunnel, point, along), point) for point in points), key=lambda place: place[0])
    found = []
    for (from_m, a), (to_m, b) in itertools.pairwise(places):
        inner = (along > from_m + 0.3) & (along < to_m - 0.3)
        way = np.vstack([a.pose[None, :3], tunnel.line_m[inner], b.pose[None, :3]])
        if to_m - from_m < _SHORT_M and isinstance(a, AccessPoint) and isinstance(b, AccessPoint):
            straight = way_between(_inward(a), b.pose)
            way = way if straight is None else straight
        names: tuple[str, str, Kind] = (a.id, b.id, _kind(a))
        one = connection(names, way, way[[0, -1]], walls, body, tunnel.speed_limit_kmh)
        if walls is None:
            one = replace(one, clearance_m=0.5 * (float(tunnel.widths_m.min()) - body.width_m))
        found.append(replace(one, feasible=True, reason="") if tunnel.driven else one)
    return found


def _place(tunnel: Tunnel, point: Point, along: FloatArray) -> float:
    """Return where along a tunnel a point is."""
    if isinstance(point, AccessPoint):
        return 0.0 if point.id.endswith(".start") else float(along[-1])
    return float(np.clip(along_m(tunnel, point.pose[None])[0], _APART_M, along[-1] - 0.1))


def _kind(a: Point) -> Kind:
    """Return the connection's type: access points face out of the node, waypoints along it."""
    return "back_back" if isinstance(a, AccessPoint) else "front_back"
