"""From what was seen along a drive to its topological map.

views + final poses -> levels -> free space, junctions and arcs of each sheet -> arcs joined -> nodes -> names, points,
connections -> edits
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.topology.arcs import SEVERAL, Heights, Mouth, arcs_of, joined
from lhdmap.topology.connections import Walls, machine_of_width
from lhdmap.topology.edits import NO_EDITS, TopologyEdits, edited, waypoints_added
from lhdmap.topology.free_space import free_space
from lhdmap.topology.graph import Graph, Niche, Scale, scale_of
from lhdmap.topology.levels import Cut, boundaries_m, cuts_of, sheets_of
from lhdmap.topology.model import AccessPoint, Intersection, TopologicalMap, Tunnel
from lhdmap.topology.names import Names, names_of, whereabouts
from lhdmap.topology.nodes import RawMap, grade_pct, raw_map
from lhdmap.topology.points import connections_of, driven_pairs, waypoints_of
from lhdmap.topology.reduce import graph_of
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.sheet import Sheet
from lhdmap.topology.views import View

_CELL_M, _FINE_CELL_M = 0.2, 0.1
_NARROW_M = 3.2  # tunnels of robots: finer cells


class Seen(NamedTuple):
    """What a drive saw: views with their poses (N, 4: x, y, z, heading), its path (M, 4) each quarter metre with times (M,).

    `said` (M): what the operator called each pose of the path, empty where nothing; `weights` (N): how often each view counts.
    """

    views: Sequence[View]
    view_poses: FloatArray
    path: FloatArray
    path_ns: npt.NDArray[np.int64]
    said: Sequence[str]
    machine: Machine | None = None
    weights: npt.NDArray[np.int64] | None = None


class Topology(NamedTuple):
    """The map, its sheets of free space, and the niches that were found beside tunnels."""

    map: TopologicalMap
    sheets: list[Sheet]
    niches: list[Niche]


def topology_of(seen: Seen, settings: TopologySettings, edits: TopologyEdits = NO_EDITS) -> Topology:
    """Return the topological map of a drive.

    Raises:
        ConfigError: an edit is about something that the map does not have.
    """
    if not len(seen.views) or not len(seen.path):
        return Topology(TopologicalMap(remarks=("no scan to make a topology of",)), [], [])
    graphs, heights, cuts = _graphs(seen, settings, edits)
    arcs = joined([arc for k, graph in enumerate(graphs) for arc in arcs_of(graph, k, heights[k], cuts)], cuts)
    raw = raw_map(arcs, graphs, heights, seen.path[:, :3])
    if not raw.tunnels:
        return Topology(TopologicalMap(remarks=("the machine hardly moved: no tunnel",)), [g.sheet for g in graphs], [])
    where = whereabouts(raw, seen.path[:, :3])
    names = names_of(raw, seen.said, where)
    topology = edited(_assembled(raw, names, where, seen, settings, edits, graphs), edits)
    return Topology(topology, [graph.sheet for graph in graphs], [niche for graph in graphs for niche in graph.niches])


def _graphs(
    seen: Seen, settings: TopologySettings, edits: TopologyEdits
) -> tuple[list[Graph], list[Heights], list[Cut]]:
    """Return the junctions of each sheet, its heights, and where the drive passes from sheet to sheet."""
    boundaries = boundaries_m(seen.view_poses, settings.level_gap_m)
    of_view, of_path = sheets_of(seen.view_poses, boundaries), sheets_of(seen.path, boundaries)
    cuts = cuts_of(seen.path, of_path)
    sheets, scale = _sheets(seen, of_view, len(boundaries) + 1, of_path, settings)
    graphs, heights = [], []
    for number, sheet in enumerate(sheets):
        own = seen.path[of_path == number]
        ends = [cut.pose for cut in cuts if number in (cut.lower, cut.lower + 1)]
        graphs.append(graph_of(sheet, own[:, :2], scale, settings, ends, edits))
        heights.append(Heights(own))
    return graphs, heights, cuts


def _sheets(
    seen: Seen, of_view: npt.NDArray[np.int64], count: int, of_path: npt.NDArray[np.int64], settings: TopologySettings
) -> tuple[list[Sheet], Scale]:
    """Return the free space of each sheet, in finer cells where tunnels are narrow, and what goes with the machine's size."""
    width = None if seen.machine is None else seen.machine.dimensions.width_m
    sheets = [_sheet(seen, of_view == number, _CELL_M, settings) for number in range(count)]
    longest = int(np.bincount(of_path, minlength=count).argmax())
    scale = scale_of(sheets[longest], seen.path[of_path == longest, :2], width, settings)
    if scale.tunnel_m < _NARROW_M:
        sheets = [_sheet(seen, of_view == number, _FINE_CELL_M, settings) for number in range(count)]
        scale = scale_of(sheets[longest], seen.path[of_path == longest, :2], width, settings)
    return sheets, scale


def _sheet(seen: Seen, chosen: npt.NDArray[np.bool_], cell_m: float, settings: TopologySettings) -> Sheet:
    rows = np.flatnonzero(chosen)
    fans = [(fan, number) for number, row in enumerate(rows.tolist()) for fan in seen.views[row].fans]
    of_fan = np.array([number for _, number in fans], dtype=np.int64)
    weights = None if seen.weights is None else seen.weights[rows]
    return free_space([fan for fan, _ in fans], seen.view_poses[rows], of_fan, cell_m, settings, weights)


def _assembled(
    raw: RawMap,
    names: Names,
    where: npt.NDArray[np.int64],
    seen: Seen,
    settings: TopologySettings,
    edits: TopologyEdits,
    graphs: list[Graph],
) -> TopologicalMap:
    """Put the parts of the map together."""
    of_junction = {node.junction: f"i{number}" for number, node in enumerate(raw.nodes, 1)}
    tunnels = [_tunnel(number, raw, names, of_junction, settings) for number in range(len(raw.tunnels))]
    intersections = [
        Intersection(
            f"i{number}",
            name,
            len(node.mouths),
            np.array([*node.middle_m, node.heading_rad]),
            node.outline_m,
            node.junction[0],
        )
        for number, (node, name) in enumerate(zip(raw.nodes, names.nodes, strict=True), 1)
    ]
    topology = TopologicalMap(tuple(tunnels), tuple(intersections), tuple(_access_points(raw, of_junction)))
    waypoints = waypoints_of(topology, names, where, seen.path, seen.path_ns, settings)
    topology = replace(topology, waypoints=(*waypoints, *waypoints_added(topology, edits)))
    walls: list[Walls | None] = [Walls(graph) for graph in graphs]
    of_node = {
        f"t{k}": walls[one.arc.sheet] if one.arc.sheet != SEVERAL else None for k, one in enumerate(raw.tunnels, 1)
    }
    of_node |= {f"i{number}": walls[node.junction[0]] for number, node in enumerate(raw.nodes, 1)}
    driven = driven_pairs(topology, where)
    connections = connections_of(
        topology, of_node, driven, seen.machine or machine_of_width(graphs[0].scale.machine_m), settings
    )
    return replace(topology, connections=tuple(connections))


def _tunnel(
    number: int, raw: RawMap, names: Names, of_junction: dict[tuple[int, int], str], settings: TopologySettings
) -> Tunnel:
    one = raw.tunnels[number]
    ends = [of_junction[end.junction] if isinstance(end, Mouth) else end for end in one.arc.ends]
    way = one.line_m[min(3, len(one.line_m) - 1)] - one.line_m[0]
    return Tunnel(
        f"t{number + 1}",
        names.tunnels[number],
        (ends[0], ends[1]),
        one.line_m,
        one.room_m,
        np.array([*one.line_m[0], math.atan2(way[1], way[0])]),
        one.arc.driven,
        speed_limit_kmh=settings.speed_limit_kmh,
        grade_max_pct=grade_pct(one.line_m),
    )


def _access_points(raw: RawMap, of_junction: dict[tuple[int, int], str]) -> list[AccessPoint]:
    """Return both access points wherever a tunnel meets an intersection."""
    found = []
    for number, tunnel in enumerate(raw.tunnels, 1):
        for side, end, pose in zip(("start", "end"), tunnel.arc.ends, tunnel.access, strict=True):
            if not isinstance(end, Mouth) or pose is None:
                continue
            node = of_junction[end.junction]
            inner, outer = f"{node}.t{number}.{side}", f"t{number}.{side}"
            outward = pose.copy()
            outward[3] = math.remainder(pose[3] + math.pi, 2.0 * math.pi)
            found += [AccessPoint(outer, f"t{number}", pose, inner), AccessPoint(inner, node, outward, outer)]
    return found
