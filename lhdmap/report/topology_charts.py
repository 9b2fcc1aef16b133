"""Pictures of the topological map: one of each level, and of a route over it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report import topology_drawing as drawing
from lhdmap.report.data import ClosureRow
from lhdmap.report.route_legs import legs_of
from lhdmap.report.topology_levels import Levels, extent_m, middle
from lhdmap.topology.model import UNEXPLORED, TopologicalMap, Tunnel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from lhdmap.movement.route import Step
    from lhdmap.topology.sheet import Sheet

HIGHEST_IN = 9.0
_MARGIN = 0.06
_LEGEND_COLUMNS, _LEGEND_ROW_IN = 5, 0.17
FORWARD, REVERSE = charts.TRUTH, charts.ODOMETRY
Names = list[tuple[str, FloatArray, float]]


def level_figure(
    topology: TopologicalMap, levels: Levels, number: int, closures: Sequence[ClosureRow] = ()
) -> tuple[Figure, int]:
    """Draw one level from above; return with it how many names had no room."""
    part = part_of(topology, levels, number)
    lines = {kind: levels.on(number, [one.line_m for one in part.tunnels if drawing.kind_of(one) == kind])
             for kind in drawing.KINDS}  # fmt: skip
    sheet = levels.all[number].sheet
    shapes = [*(line for own in lines.values() for line in own), *(one.outline_m for one in part.intersections)]
    figure, axes = _plan([*shapes, *([] if sheet is None else [extent_m(sheet)])])
    if sheet is not None:
        drawing.draw_free_space(axes, sheet)
    drawing.draw_intersections(axes, part.intersections)
    for kind, own in lines.items():
        colour, style = drawing.KINDS[kind]
        drawing.draw_lines(axes, own, colour, style, drawing.KIND_WORDS[kind], linewidth=1.8, zorder=2.0)
    _draw_connections(axes, part, levels, number)
    drawing.draw_closures(axes, [one for one in closures if (levels.of(np.array([one.from_m])) == number)[0]])
    drawing.draw_access_points(axes, part.access_points)
    drawing.draw_waypoints(axes, part.waypoints)
    _draw_ends(axes, topology, levels, number)
    _finish(figure, axes)
    left_out = drawing.draw_labels(axes, names_of(part, levels, number), _drawn(part, lines.values()))
    return figure, left_out


def _drawn(part: TopologicalMap, lines: Iterable[Sequence[FloatArray]]) -> list[FloatArray]:
    """Return what names are to keep off: centre lines (N, 3), and where points and crossed-out connections are."""
    marks = [*(one.pose for one in part.waypoints), *(one.pose for one in part.access_points)]
    marks += [middle(one.line_m) for one in part.connections if one.closed or not one.feasible]
    return [*(line for own in lines for line in own), *(mark[None, :2] for mark in marks)]


def part_of(topology: TopologicalMap, levels: Levels, number: int) -> TopologicalMap:
    """Return what of a map is on a level; a tunnel that leads from one to another is on both."""

    def here(poses: Sequence[FloatArray]) -> list[bool]:
        points = np.array([pose[:3] for pose in poses]).reshape(-1, 3)
        return (levels.of(points) == number).tolist()

    def kept(items: Sequence[Any], poses: Sequence[FloatArray]) -> tuple[Any, ...]:
        return tuple(item for item, flag in zip(items, here(poses), strict=True) if flag)

    tunnels = tuple(one for one in topology.tunnels if (levels.of(one.line_m) == number).any())
    return TopologicalMap(
        tunnels,
        kept(topology.intersections, [one.pose_map_node for one in topology.intersections]),
        kept(topology.access_points, [one.pose for one in topology.access_points]),
        kept(topology.waypoints, [one.pose for one in topology.waypoints]),
        kept(topology.connections, [one.line_m[len(one.line_m) // 2] for one in topology.connections]),
    )


def names_of(part: TopologicalMap, levels: Levels, number: int) -> Names:
    """Return the names on a level with their places, and the size of the mark there: waypoints, intersections, tunnels."""
    names: Names = [(one.name, one.pose, 4.5) for one in part.waypoints]
    said = {(one.node, one.name) for one in part.waypoints}
    names += [(one.name, one.pose_map_node, 1.0) for one in part.intersections]
    for tunnel in part.tunnels:
        own = max(levels.on(number, [tunnel.line_m]), key=len, default=tunnel.line_m)
        if (tunnel.id, tunnel.name) not in said and len(own):
            names.append((tunnel.name, middle(own), 1.5))
    return names


def route_figure(topology: TopologicalMap, route_states: Sequence[Step], sheets: Sequence[Sheet] = ()) -> Figure:
    """Draw a route over its map: forward green, reverse orange, where it changes gear or turns, start and goal."""
    legs = legs_of(topology, route_states)
    lines = [one.line_m for one in topology.tunnels]
    figure, axes = _plan([*lines, *(one.outline_m for one in topology.intersections), *(leg.line_m for leg in legs)])
    for sheet in sheets:
        drawing.draw_free_space(axes, sheet, 0.6)
    drawing.draw_lines(axes, lines, drawing.GREY, "-", "tunnel", linewidth=1.0, zorder=2.0)
    for gear, colour in (("forward", FORWARD), ("reverse", REVERSE)):
        own = [leg.line_m for leg in legs if leg.gear == gear]
        drawing.draw_lines(axes, own, colour, "-", gear, linewidth=2.6, zorder=2.6)
        heads = [pose for line in own for pose in _heads(line)]
        drawing.draw_arrows(axes, heads, colour, "_heads", length=11.0, shaft=2.6)
    stops = [(one, topology.points[one.point]) for one in route_states]
    ring = {"markerfacecolor": "none", "markeredgewidth": 2.0, "markersize": 9}
    drawing.draw_marks(
        axes, [point.pose for one, point in stops if one.inversion], "o", charts.FLAGGED, "inversion", **ring
    )
    drawing.draw_marks(
        axes, [point.pose for one, point in stops if one.turn], "D", charts.FLAGGED, "turns round", **ring
    )
    if stops:
        drawing.draw_marks(axes, [stops[0][1].pose], "o", charts.FINAL, "start", markersize=7)
        drawing.draw_marks(axes, [stops[-1][1].pose], "*", charts.WHEELS, "goal", markersize=11)
    _finish(figure, axes)
    drawing.draw_labels(axes, _names_on(topology, route_states), [*lines, *(leg.line_m for leg in legs)])
    return figure


def _names_on(topology: TopologicalMap, steps: Sequence[Step]) -> Names:
    """Return the names of what a route passes: its waypoints, the nodes that it is in."""
    points = dict.fromkeys(one.point for one in steps)
    waypoints = [one for one in topology.waypoints if one.id in points]
    nodes = [topology.nodes[node] for node in dict.fromkeys(one.node for one in steps)]
    said = {(one.node, one.name) for one in waypoints}
    return [
        *((one.name, one.pose, 6.0) for one in waypoints),
        *(
            (one.name, middle(one.line_m) if isinstance(one, Tunnel) else one.pose_map_node, 2.0)
            for one in nodes
            if (one.id, one.name) not in said
        ),
    ]


def _heads(line_m: FloatArray, each_m: float = 25.0) -> list[FloatArray]:
    """Return poses (4,) along a line (N, 3) where an arrow shows the way, at least one of a line that is not short."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))])
    count = int(at[-1] // each_m) or int(at[-1] > 6.0)
    heads = []
    for along in (np.arange(count) + 0.5) * at[-1] / max(count, 1):
        k = min(int(np.searchsorted(at, along, side="right")) - 1, len(line_m) - 2)
        dx, dy = line_m[k + 1, :2] - line_m[k, :2]
        x, y = (float(np.interp(along, at, line_m[:, axis])) for axis in (0, 1))
        heads.append(np.array([x, y, 0.0, np.arctan2(dy, dx)]))
    return heads


def _plan(shapes_m: Sequence[FloatArray]) -> tuple[Figure, Axes]:
    """Return axes that hold all shapes (N, 2 or more) with equal scales and some room for names at the edges."""
    points = np.vstack([shape[:, :2] for shape in shapes_m if len(shape)] or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = np.maximum(_MARGIN * (high - low), 4.0)
    corners = np.array([low - margin, high + margin])
    figure = charts.new_figure(charts.plan_height_in(corners, least=2.8, most=HIGHEST_IN) + 2 * _LEGEND_ROW_IN)
    axes = figure.add_subplot()
    axes.set(xlim=corners[:, 0], ylim=corners[:, 1])
    axes.set(autoscale_on=False, xlabel="x, m", ylabel="y, m")
    return figure, axes


def _finish(figure: Figure, axes: Axes) -> None:
    """Put the legend above, in as many rows as it needs, and widen the limits to equal scales in what room is left."""
    axes.grid(visible=False)
    handles, _ = axes.get_legend_handles_labels()
    rows = -(-len(handles) // _LEGEND_COLUMNS)
    height_in = float(figure.get_figheight())
    figure.subplots_adjust(top=1.0 - (0.12 + _LEGEND_ROW_IN * rows) / height_in)
    charts.legend_above(axes, columns=_LEGEND_COLUMNS)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    room = np.array([axes.bbox.width, axes.bbox.height])
    half = 0.5 * room * float(((high - low) / room).max())
    axes.set(
        xlim=(low + high)[0] / 2 + half[0] * np.array([-1, 1]), ylim=(low + high)[1] / 2 + half[1] * np.array([-1, 1])
    )
    axes.set_aspect("equal")


def _draw_connections(axes: Axes, part: TopologicalMap, levels: Levels, number: int) -> None:
    """Mark the connections that cannot be driven, or that an operator has closed."""
    for closed, colour, mark, words in (
        (False, charts.WHEELS, "x", "connection, infeasible"),
        (True, charts.FLAGGED, "x", "connection, closed"),
    ):
        own = [one for one in part.connections if (one.closed if closed else not one.feasible and not one.closed)]
        lines = levels.on(number, [one.line_m for one in own])
        drawing.draw_lines(axes, lines, colour, ":", "_connections", linewidth=1.3, zorder=2.4)
        drawing.draw_marks(axes, [middle(one.line_m) for one in own], mark, colour, words, markersize=6)


def _draw_ends(axes: Axes, topology: TopologicalMap, levels: Levels, number: int) -> None:
    """Mark where a tunnel goes on unseen, and where it leads to another level."""
    ends = [
        end for tunnel in topology.tunnels for end, what in zip((tunnel.line_m[0], tunnel.line_m[-1]), tunnel.ends, strict=True)
        if what == UNEXPLORED
    ]  # fmt: skip
    here = [end for end in ends if (levels.of(end[None]) == number)[0]]
    drawing.draw_marks(axes, here, "$?$", charts.FLAGGED, "unexplored", markersize=9)
    across = []
    for tunnel in topology.tunnels:
        flags = levels.of(tunnel.line_m) == number
        across += [tunnel.line_m[k] for k in np.flatnonzero(flags[1:] != flags[:-1]) + 1]
    drawing.draw_marks(axes, across, "s", charts.FINAL, "to another level", markerfacecolor="none", markersize=8)
