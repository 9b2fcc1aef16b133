"""The map as a plain graph of places: access points and waypoints, and the ways between them.

The two access points where two nodes meet are one place. Gears and inversions are not in it: `lhdmap route` knows them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from lhdmap.topology.model import AccessPoint, Connection, Point, TopologicalMap, Tunnel, Waypoint

KMH = 1.0 / 3.6


class Place(NamedTuple):
    """A place: `points` are the map's that are there, one or two twins; the pose is that of the first."""

    points: tuple[Point, ...]

    @property
    def name(self) -> str:
        """Id of its first access point, or the waypoint's name."""
        first = self.points[0]
        return first.name if isinstance(first, Waypoint) else first.id

    @property
    def kind(self) -> str:
        """`access_point`, or the waypoint's purpose."""
        first = self.points[0]
        return first.purpose if isinstance(first, Waypoint) else "access_point"


class Way(NamedTuple):
    """A way both ways between two places (their indices), within a node of the map; `time_s` at its speed."""

    start: int
    end: int
    connection: Connection
    node: str
    time_s: float
    drivable: bool


@dataclass(frozen=True)
class PlacesGraph:
    """Places and ways; a multigraph: two places may be joined by several ways."""

    places: tuple[Place, ...]
    ways: tuple[Way, ...]


def places_graph(topology: TopologicalMap, times_s: Mapping[tuple[str, str], float] | None = None) -> PlacesGraph:
    """Return the graph of a map; `times_s`: what each connection costs (else its length at its speed limit)."""
    places: list[Place] = []
    index: dict[str, int] = {}
    for point in topology.points.values():
        if point.id in index:
            continue
        twin = topology.points.get(point.joins or "") if isinstance(point, AccessPoint) else None
        both = (point,) if twin is None or twin.id in index else (point, twin)
        index |= {one.id: len(places) for one in both}
        places.append(Place(both))
    ways = [
        Way(
            index[one.start],
            index[one.end],
            one,
            _node(topology, one),
            _time_s(one, times_s or {}),
            _open(topology, one),
        )
        for one in topology.connections
        if one.start in index and one.end in index
    ]
    return PlacesGraph(tuple(places), tuple(ways))


def unique_names(graph: PlacesGraph) -> list[str]:
    """Return a name for each place; where two have the same one, its id follows."""
    names = [place.name for place in graph.places]
    return [
        name if names.count(name) == 1 else f"{name}_{place.points[0].id}"
        for name, place in zip(names, graph.places, strict=True)
    ]


def drivable_ways(graph: PlacesGraph) -> list[Way]:
    """Return the ways that can be driven; of those between the same two places in one node the quickest."""
    best: dict[tuple[frozenset[int], str], Way] = {}
    for way in graph.ways:
        key = (frozenset((way.start, way.end)), way.node)
        if way.drivable and way.start != way.end and (key not in best or way.time_s < best[key].time_s):
            best[key] = way
    return list(best.values())


def _node(topology: TopologicalMap, connection: Connection) -> str:
    return topology.points[connection.start].node


def _open(topology: TopologicalMap, connection: Connection) -> bool:
    node = topology.nodes.get(_node(topology, connection))
    closed = isinstance(node, Tunnel) and node.closed
    return connection.feasible and not connection.closed and not closed


def _time_s(connection: Connection, times_s: Mapping[tuple[str, str], float]) -> float:
    known = times_s.get((connection.start, connection.end))
    return known if known is not None else connection.length_m / (max(connection.speed_limit_kmh, 0.1) * KMH)
