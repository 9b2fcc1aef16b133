"""Places of a mission on a map whose names do not say what they are for: `with_work(topology, sources, dumps, parks)`.

The teaching drive says names, and `purpose_of` knows the usual ones. A mission says more: what it loads at is a draw point, what
it dumps at a dump, and where its machine begins it is parked again.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from lhdmap.errors import UsageError
from lhdmap.settings import nearest
from lhdmap.topology.model import DEAD_END, Purpose, TopologicalMap, Tunnel, Waypoint


def with_work(
    topology: TopologicalMap, sources: Iterable[str], dumps: Iterable[str], parks: Iterable[str] = ()
) -> TopologicalMap:
    """Return the map with the points of a mission for what it uses them for, called as the mission calls them.

    A dead end is as good a name as the point at its end. A start that is no point (a node, an access point), and one that is a
    point of work, stays what it is.

    Raises:
        UsageError: a source or dump is not on the map, or no point.
    """
    for name in sources:
        topology = _as(topology, name, "draw_point")
    for name in dumps:
        topology = _as(topology, name, "dump")
    for name in parks:
        found = point_called(topology, name)
        if found is not None and found.purpose not in ("draw_point", "dump"):
            topology = _as(topology, name, "park")
    return topology


def point_called(topology: TopologicalMap, name: str) -> Waypoint | None:
    """Return the waypoint of this name or id, or the one nearest the end of the dead end that is called so."""
    found = topology.called(name) if name else None
    if isinstance(found, Tunnel) and DEAD_END in found.ends:
        end_m = found.line_m[0 if found.ends[0] == DEAD_END else -1]
        within = [one for one in topology.waypoints if one.node == found.id]
        return min(within, key=lambda one: float(((one.pose[:3] - end_m) ** 2).sum()), default=None)
    return found if isinstance(found, Waypoint) else None


def _as(topology: TopologicalMap, name: str, purpose: Purpose) -> TopologicalMap:
    found = point_called(topology, name)
    if found is None:
        ends = [one.name for one in topology.tunnels if point_called(topology, one.name) is not None]
        known = list(dict.fromkeys([*ends, *(one.name for one in topology.waypoints)]))
        said = "is no point" if topology.called(name) is not None else "is not on the map"
        raise UsageError(f"mission: '{name}' {said}{nearest(name, known)}")
    changed = replace(found, name=found.name if name == found.id else name, purpose=purpose)
    return replace(topology, waypoints=tuple(changed if one is found else one for one in topology.waypoints))
