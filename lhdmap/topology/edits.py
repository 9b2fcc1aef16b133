"""What a user changes in a topology, as a small TOML file that each rebuild of the map respects.

Nodes are named by name or id, or by a place `at_m = [x, y]` in `map`: places stay when generated names change.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.messages import FloatArray
from lhdmap.settings import REQUIRED, nearest, setting
from lhdmap.settings_tree import load_tree, part
from lhdmap.topology.model import (
    PREFERENCES,
    PURPOSES,
    Connection,
    Intersection,
    Preference,
    Purpose,
    TopologicalMap,
    Tunnel,
    Waypoint,
)

_NOWHERE = (math.inf, math.inf)
_NEAREST_M = 15.0
_Edit = TypeVar("_Edit")


@dataclass(frozen=True, slots=True)
class Rename:
    """Another name for a node or waypoint."""

    node: str = setting("", doc="Name or id; or say at_m.")
    at_m: tuple[float, float] = setting(_NOWHERE, unit="m", doc="Place in the map, x and y.")
    name: str = setting(REQUIRED, doc="The new name.")


@dataclass(frozen=True, slots=True)
class Spot:
    """A place in the map where junctions are to be one, or to stay apart."""

    at_m: tuple[float, float] = setting(REQUIRED, unit="m", doc="Place in the map, x and y.")


@dataclass(frozen=True, slots=True)
class NewWaypoint:
    """A waypoint that the drive did not tell of."""

    name: str = setting(REQUIRED, doc="Its name.")
    at_m: tuple[float, float] = setting(
        REQUIRED, unit="m", doc="Place in the map, x and y; the tunnel's line is nearest."
    )
    purpose: str = setting("stop", choices=PURPOSES, doc="What it is for.")
    speed_limit_kmh: float = setting(12.0, unit="km/h", minimum=0.5, maximum=60.0, doc="Speed limit there.")


@dataclass(frozen=True, slots=True)
class Close:
    """A tunnel that is not to be driven."""

    node: str = setting("", doc="Name or id of the tunnel; or say at_m.")
    at_m: tuple[float, float] = setting(_NOWHERE, unit="m", doc="Place in the map, x and y.")


@dataclass(frozen=True, slots=True)
class Limit:
    """Speed limit and wall preference of a tunnel."""

    node: str = setting("", doc="Name or id of the tunnel; or say at_m.")
    at_m: tuple[float, float] = setting(_NOWHERE, unit="m", doc="Place in the map, x and y.")
    speed_limit_kmh: float = setting(12.0, unit="km/h", minimum=0.5, maximum=60.0, doc="Speed limit.")
    wall_preference: str = setting("centre", choices=PREFERENCES, doc="Which wall to keep to.")


@dataclass(frozen=True, slots=True)
class TopologyEdits:
    """All edits of a file: [[rename]], [[merge]], [[split]], [[add]], [[close]], [[limit]]."""

    rename: tuple[Rename, ...] = part(tuple)
    merge: tuple[Spot, ...] = part(tuple)
    split: tuple[Spot, ...] = part(tuple)
    add: tuple[NewWaypoint, ...] = part(tuple)
    close: tuple[Close, ...] = part(tuple)
    limit: tuple[Limit, ...] = part(tuple)

    @property
    def apart_m(self) -> FloatArray:
        """Places (K, 2) whose junctions stay apart."""
        return np.array([spot.at_m for spot in self.split], dtype=float).reshape(-1, 2)

    @property
    def together_m(self) -> FloatArray:
        """Places (K, 2) whose junctions are one."""
        return np.array([spot.at_m for spot in self.merge], dtype=float).reshape(-1, 2)


NO_EDITS = TopologyEdits()


def load_edits(path: Path | None) -> TopologyEdits:
    """Return the edits of a TOML file, none where there is none.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    return NO_EDITS if path is None else load_tree(TopologyEdits, path, "topology edits")


def edited(topology: TopologicalMap, edits: TopologyEdits) -> TopologicalMap:
    """Return a map with names, limits, closures and waypoints as the edits say (merge and split come before).

    Raises:
        ConfigError: an edit is about something that the map does not have.
    """
    for close in edits.close:
        tunnel = _tunnel(topology, close.node, close.at_m, "close")
        topology = _with_tunnel(topology, replace(tunnel, closed=True))
        topology = _with_connections(topology, tunnel.id, lambda one: replace(one, closed=True))
    for limit in edits.limit:
        tunnel = _tunnel(topology, limit.node, limit.at_m, "limit")
        speed, wall = limit.speed_limit_kmh, _preference(limit.wall_preference)
        topology = _with_tunnel(topology, replace(tunnel, speed_limit_kmh=speed, wall_preference=wall))
        topology = _with_connections(topology, tunnel.id, partial(_limited, speed_kmh=speed))
    for rename in edits.rename:
        topology = _renamed(topology, rename)
    return topology


def _limited(one: Connection, speed_kmh: float) -> Connection:
    return replace(one, speed_limit_kmh=speed_kmh)


def waypoints_added(topology: TopologicalMap, edits: TopologyEdits) -> list[Waypoint]:
    """Return the waypoints that the edits add, on the tunnels' lines."""
    found = []
    for number, new in enumerate(edits.add, 1):
        tunnel = _tunnel(topology, "", new.at_m, "add")
        row = int(np.linalg.norm(tunnel.line_m[:, :2] - new.at_m, axis=1).argmin())
        way = tunnel.line_m[min(row + 1, len(tunnel.line_m) - 1)] - tunnel.line_m[max(row - 1, 0)]
        pose = np.array([*tunnel.line_m[row], math.atan2(way[1], way[0])])
        found.append(Waypoint(f"u{number}", new.name, tunnel.id, pose, _purpose(new.purpose), new.speed_limit_kmh))
    return found


def _renamed(topology: TopologicalMap, rename: Rename) -> TopologicalMap:
    found: Any = topology.called(rename.node) if rename.node else _node_at(topology, rename.at_m, "rename")
    if found is None or not isinstance(found, (Tunnel, Intersection, Waypoint)):
        raise ConfigError(f"[[rename]]: no node '{rename.node}'{nearest(rename.node, topology.names())}")

    def swapped(one: _Edit) -> _Edit:
        return replace(one, name=rename.name) if one is found else one

    return replace(
        topology,
        tunnels=tuple(map(swapped, topology.tunnels)),
        intersections=tuple(map(swapped, topology.intersections)),
        waypoints=tuple(map(swapped, topology.waypoints)),
    )


def _node_at(topology: TopologicalMap, at_m: tuple[float, float], what: str) -> Tunnel | Intersection:
    places: list[tuple[float, Tunnel | Intersection]] = [
        (float(np.linalg.norm(node.pose_map_node[:2] - at_m)) - 4.0, node) for node in topology.intersections
    ]
    places += [(_apart_m(tunnel, at_m), tunnel) for tunnel in topology.tunnels]
    apart, node = min(places, key=lambda place: place[0], default=(math.inf, None))
    if node is None or apart > _NEAREST_M:
        raise ConfigError(f"[[{what}]]: nothing of the map is near {list(at_m)}")
    return node


def _tunnel(topology: TopologicalMap, name: str, at_m: tuple[float, float], what: str) -> Tunnel:
    if name:
        tunnel = next((one for one in topology.tunnels if name in (one.id, one.name)), None)
        if tunnel is None:
            names = [one.name for one in topology.tunnels]
            raise ConfigError(f"[[{what}]]: no tunnel '{name}'{nearest(name, names)}")
        return tunnel
    tunnel = min(topology.tunnels, key=lambda one: _apart_m(one, at_m), default=None)
    if tunnel is None or _apart_m(tunnel, at_m) > _NEAREST_M:
        raise ConfigError(f"[[{what}]]: no tunnel is near {list(at_m)}")
    return tunnel


def _apart_m(tunnel: Tunnel, at_m: tuple[float, float]) -> float:
    return float(np.linalg.norm(tunnel.line_m[:, :2] - at_m, axis=1).min())


def _with_tunnel(topology: TopologicalMap, tunnel: Tunnel) -> TopologicalMap:
    return replace(topology, tunnels=tuple(tunnel if one.id == tunnel.id else one for one in topology.tunnels))


def _with_connections(
    topology: TopologicalMap, node: str, change: Callable[[Connection], Connection]
) -> TopologicalMap:
    points = {point.id for point in topology.points_of(node)}
    return replace(
        topology,
        connections=tuple(change(one) if one.start in points else one for one in topology.connections),
    )


def _purpose(text: str) -> Purpose:
    return next(one for one in PURPOSES if one == text)


def _preference(text: str) -> Preference:
    return next(one for one in PREFERENCES if one == text)
