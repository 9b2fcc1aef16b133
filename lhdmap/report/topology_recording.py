"""The topological map in a Rerun recording: `map/topology/…`, and a route over it: `map/route/…`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report.data import ClosureRow
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun
from lhdmap.report.route_legs import legs_of
from lhdmap.report.topology_drawing import kind_of
from lhdmap.report.topology_levels import middle
from lhdmap.topology.model import PURPOSES, Point, TopologicalMap

if TYPE_CHECKING:
    from lhdmap.movement.route import Step

_ABOVE_M = 0.3  # over the floor, so that points of the cloud do not hide it
_ARROW, _MOST_ARROW_M = 0.65, 4.0  # of a tunnel's width
_BLUE, _ORANGE, _GREEN, _RED, _PINK, _YELLOW = 0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF, 0xCC79A7FF, 0xF0C419FF
_WHITE, _DIM = 0xF2F2F2FF, 0x8A949EFF
_TUNNELS = {
    "driven": (_BLUE, "blue line in the topology", "tunnel, driven"),
    "seen": (_ORANGE, "orange line", "tunnel, only seen"),
    "closed": (_RED, "red line", "tunnel, closed"),
}
_CLOSURES = ((True, "accepted", _GREEN, "green thin line"), (False, "refused", _PINK, "pink thin line"))


def add_topology(writer: RecordingWriter, topology: TopologicalMap, closures: Sequence[ClosureRow] = ()) -> None:
    """Record tunnels, intersections, access points, waypoints, connections and loop closures; nothing of what there is none."""
    _add_tunnels(writer, topology)
    _add_intersections(writer, topology)
    long_m = _arrow_m(topology)
    ids = [one.id for one in topology.access_points]
    _add_arrows(writer, "access_points", topology.access_points, long_m, _WHITE, ids)
    for purpose in PURPOSES:
        own = [one for one in topology.waypoints if one.purpose == purpose]
        _add_arrows(writer, f"waypoints/{purpose}", own, 1.4 * long_m, _GREEN, [one.name for one in own], shown=True)
    if topology.access_points:
        writer.explain("white arrow", "access point, out of its node")
    if topology.waypoints:
        writer.explain("green arrow with a name", "waypoint, in its heading")
    _add_connections(writer, topology)
    _add_closures(writer, closures)
    writer.layout.has_topology = writer.layout.has_topology or bool(topology.tunnels)


def record_route(writer: RecordingWriter, topology: TopologicalMap, route_states: Sequence[Step]) -> None:
    """Record a route: forward green, reverse orange, where it changes gear or turns, start and goal."""
    rr = rerun()
    legs = legs_of(topology, route_states)
    for gear, rgba, colour in (("forward", _GREEN, "green"), ("reverse", _ORANGE, "orange")):
        lines = [raised(leg.line_m, 2.0 * _ABOVE_M) for leg in legs if leg.gear == gear]
        if lines:
            writer.add_shape(f"map/route/{gear}", rr.LineStrips3D(lines, colors=rgba, radii=rr.Radius.ui_points(4.0)))
            writer.explain(f"{colour} thick line", f"route, {gear}")
    stops = [(step, topology.points[step.point].pose[:3]) for step in route_states]
    marks = [
        (at, "inversion" if step.inversion else "turns round") for step, at in stops if step.inversion or step.turn
    ]
    if marks:
        _add_marks(writer, "map/route/inversions", [at for at, _ in marks], _PINK, [name for _, name in marks])
        writer.explain("pink ball", "inversion: the route changes gear, or turns round")
    if stops:
        ends = [getattr(topology.points[route_states[k].point], "name", route_states[k].point) for k in (0, -1)]
        _add_marks(
            writer, "map/route/ends", [stops[0][1], stops[-1][1]], _YELLOW, [f"start {ends[0]}", f"goal {ends[1]}"]
        )


def write_topology_recording(
    path: Path, title: str, topology: TopologicalMap, route_states: Sequence[Step] = ()
) -> None:
    """Write a `.rrd` file of a topological map alone, with a route where one is given."""
    with RecordingWriter(path, title, 0) as writer:
        writer.layout.curves = ()
        add_topology(writer, topology)
        if route_states:
            record_route(writer, topology, route_states)
        writer.layout.has_topology = False  # nothing else is in it: the views of the map show it


def raised(points_m: FloatArray, by_m: float = _ABOVE_M) -> FloatArray:
    """Return points (N, 3) a little over the floor."""
    return points_m + np.array([0.0, 0.0, by_m])


def _add_tunnels(writer: RecordingWriter, topology: TopologicalMap) -> None:
    """Record centre lines; the name that a waypoint in a tunnel has, too, stands there alone."""
    rr = rerun()
    for kind, (rgba, drawn, meaning) in _TUNNELS.items():
        own = [one for one in topology.tunnels if kind_of(one) == kind]
        names = [one.name for one in own]
        _add_lines(writer, f"map/topology/tunnels/{kind}", [raised(one.line_m) for one in own], rgba, 2.0, names)
        if own:
            writer.explain(drawn, meaning)
            writer.widen(np.vstack([one.line_m for one in own]))
    said = {(one.node, one.name) for one in topology.waypoints}
    named = [one for one in topology.tunnels if (one.id, one.name) not in said]
    if named:
        at, size = raised(np.array([middle(one.line_m) for one in named])), rr.Radius.ui_points(0.5)
        labels = [one.name for one in named]
        names_shape = rr.Points3D(at, colors=_BLUE, radii=size, labels=labels, show_labels=True)
        writer.add_shape("map/topology/tunnels/names", names_shape)


def _add_intersections(writer: RecordingWriter, topology: TopologicalMap) -> None:
    own = [one for one in topology.intersections if len(one.outline_m)]
    rings = [_at_height(np.vstack([one.outline_m, one.outline_m[:1]]), one.pose_map_node[2]) for one in own]
    _add_lines(writer, "map/topology/intersections", rings, _YELLOW, 1.8, [one.name for one in own], shown=True)
    if own:
        writer.explain("yellow outline", "intersection")
        writer.widen(np.vstack(rings))


def _at_height(outline_m: FloatArray, height_m: float) -> FloatArray:
    return np.column_stack([outline_m, np.full(len(outline_m), height_m + _ABOVE_M)])


def _arrow_m(topology: TopologicalMap) -> float:
    """Return how long an arrow is: less than a tunnel is wide."""
    widths = [float(one.widths_m.mean()) for one in topology.tunnels if len(one.half_widths_m)]
    return min(_ARROW * float(np.median(widths)), _MOST_ARROW_M) if widths else _MOST_ARROW_M


def _add_arrows(
    writer: RecordingWriter,
    name: str,
    points: Sequence[Point],
    long_m: float,
    rgba: int,
    labels: Sequence[str],
    *,
    shown: bool = False,
) -> None:
    """Record poses as arrows; names that are not shown, there are many of access points, are seen on selection."""
    rr = rerun()
    if points:
        poses = np.array([one.pose for one in points])
        ahead = long_m * np.column_stack([np.cos(poses[:, 3]), np.sin(poses[:, 3]), np.zeros(len(poses))])
        size, origins = rr.Radius.ui_points(1.6), raised(poses[:, :3])
        arrows = rr.Arrows3D(origins=origins, vectors=ahead, colors=rgba, radii=size, labels=labels, show_labels=shown)
        writer.add_shape(f"map/topology/{name}", arrows)


def _add_connections(writer: RecordingWriter, topology: TopologicalMap) -> None:
    for name, rgba, colour, chosen in (
        ("feasible", _DIM, "grey", [one for one in topology.connections if one.feasible and not one.closed]),
        ("infeasible", _RED, "red", [one for one in topology.connections if not one.feasible]),
        ("closed", _PINK, "pink", [one for one in topology.connections if one.feasible and one.closed]),
    ):
        if chosen:
            lines = [raised(one.line_m, 0.5 * _ABOVE_M) for one in chosen]
            _add_lines(writer, f"map/topology/connections/{name}", lines, rgba, 1.0)
            writer.explain(f"{colour} thin line", f"connection, {name}")


def _add_closures(writer: RecordingWriter, closures: Sequence[ClosureRow]) -> None:
    measured = [one for one in closures if one.accepted or math.isfinite(one.residual_m)]
    for accepted, name, rgba, drawn in _CLOSURES:
        lines = [raised(np.array([one.from_m, one.to_m])) for one in measured if one.accepted == accepted]
        if lines:
            _add_lines(writer, f"map/topology/closures/{name}", lines, rgba, 0.8)
            writer.explain(drawn, f"loop closure, {name}")


def _add_lines(
    writer: RecordingWriter,
    entity: str,
    lines: Sequence[FloatArray],
    rgba: int,
    size: float,
    labels: Sequence[str] | None = None,
    *,
    shown: bool = False,
) -> None:
    """Record lines (N, 3) of a size in points on screen; nothing where there is none."""
    rr = rerun()
    if lines:
        radii = rr.Radius.ui_points(size)
        strips = rr.LineStrips3D(lines, colors=rgba, radii=radii, labels=labels, show_labels=shown)
        writer.add_shape(entity, strips)


def _add_marks(
    writer: RecordingWriter, entity: str, at: Sequence[FloatArray], rgba: int, labels: Sequence[str]
) -> None:
    rr = rerun()
    points = raised(np.array(at), 3.0 * _ABOVE_M)
    shape = rr.Points3D(points, colors=rgba, radii=rr.Radius.ui_points(7.0), labels=labels, show_labels=True)
    writer.add_shape(entity, shape)
