"""The layout of a mine's topological map: nodes become kinds of edges, waypoints the points of work.

A point of the layout is where two nodes meet (a gate, named after the access point with the smaller name) or a waypoint. Each
feasible connection is an edge both ways: an LHD drives in both gears, so a way into a draw point is a way out, too. A tunnel with
a dead end and a waypoint of work is an area; what leads to its waypoint is a dock, and its gate the queue point.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

from lhdmap.haulage.layout import Edge, Layout, Point, Purpose
from lhdmap.haulage.states import State
from lhdmap.topology.model import DEAD_END, AccessPoint, Connection, Intersection, TopologicalMap, Tunnel

_PURPOSES = {"draw_point": "load", "dump": "dump", "park": "park"}


def layout_of_map(topology: TopologicalMap, name: str = "map") -> Layout:
    """Return the layout of a map; it is not checked for what a mission wants (`lhdmap.haulage.layout.checked`)."""
    return _Maker(topology).layout(name)


class _Maker:
    def __init__(self, topology: TopologicalMap) -> None:
        self._map = topology
        self._works = {one.id: _PURPOSES[one.purpose] for one in topology.waypoints if one.purpose in _PURPOSES}
        self._waypoints = {one.name: one.id for one in topology.waypoints}
        of_work = {one.node for one in topology.waypoints if one.id in self._works}
        self._areas = {one.id for one in topology.tunnels if one.id in of_work and DEAD_END in one.ends}

    def layout(self, name: str) -> Layout:
        """Return the layout: edges of open connections, points where they meet, what is done in each area."""
        edges = tuple(edge for one in self._map.connections if self._open(one) for edge in self._edges(one))
        docks = {edge.start for edge in edges if edge.kind == State.DOCK}
        names = dict.fromkeys(point for edge in edges for point in (edge.start, edge.end))
        points = tuple(self._point(point, queue=point in docks) for point in names)
        roles = {
            self._named(one.node): self._works[one.id]
            for one in self._map.waypoints
            if one.id in self._works and one.node in self._areas
        }
        return Layout(name, points, edges, roles, {key: node.name for key, node in self._map.nodes.items()})

    def _open(self, one: Connection) -> bool:
        node = self._map.nodes.get(self._map.points[one.start].node)
        return one.feasible and not one.closed and not (isinstance(node, Tunnel) and node.closed)

    def _point(self, name: str, *, queue: bool) -> Point:
        waypoint = self._waypoints.get(name, "")
        if waypoint in self._works:
            node = self._map.points[waypoint].node
            return Point(name, cast("Purpose", self._works[waypoint]), self._named(node) if node in self._areas else "")
        return Point(name, "queue" if queue else "", "")

    def _edges(self, one: Connection) -> Iterator[Edge]:
        points = self._map.points
        node = points[one.start].node
        for start, end, line in ((one.start, one.end, one.line_m), (one.end, one.start, one.line_m[::-1])):
            kind = self._kind(node, start, end)
            area = self._named(node) if node in self._areas else ""
            yield Edge(
                self._gate(start),
                self._gate(end),
                kind,
                one.length_m,
                area,
                self._named(node),
                line_m=line,
                speed_kmh=one.speed_limit_kmh,
            )

    def _kind(self, node: str, start: str, end: str) -> State:
        if isinstance(self._map.nodes[node], Intersection):
            off = self._beyond(end) in self._areas
            return State.JUNCTION_OFF if off else State.JUNCTION_ON if self._is_area(start) else State.THROUGH
        if end in self._works:
            return State.DOCK
        return State.AREA_OUT if start in self._works else State.AREA_IN if node in self._areas else State.ROAD

    def _is_area(self, point: str) -> bool:
        return self._beyond(point) in self._areas

    def _beyond(self, point: str) -> str:
        """Return the node on the other side of an access point."""
        one = self._map.points[point]
        twin = self._map.points.get(one.joins or "") if isinstance(one, AccessPoint) else None
        return twin.node if twin is not None else ""

    def _gate(self, point: str) -> str:
        one = self._map.points[point]
        if isinstance(one, AccessPoint):
            return min(one.id, one.joins) if one.joins else one.id
        return one.name

    def _named(self, node: str) -> str:
        return self._map.nodes[node].name
