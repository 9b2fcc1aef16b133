"""The picture of a difference report: walls that came in red, that went in blue, the rest of the map in grey."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.report import charts
from lhdmap.report.topology_drawing import draw_free_space
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import UNKNOWN, Sheet
from lhdmap.update.difference import Walls

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CAME, _WENT = "#d32f2f", "#1e88e5"
_MARK_PT = 3.0
_MARGIN_M = 2.0


def difference_figures(topology: TopologicalMap, sheets: Sequence[Sheet], walls: Sequence[Walls]) -> list[Figure]:
    """Return a picture of each level; to be called and drawn in `charts.styled()`."""
    return [
        _figure(topology, sheet, walls[number] if number < len(walls) else None, number, several=len(sheets) > 1)
        for number, sheet in enumerate(sheets)
    ]


def _figure(topology: TopologicalMap, sheet: Sheet, walls: Walls | None, level: int, *, several: bool) -> Figure:
    drawn = sheet.middles_m(np.argwhere(sheet.cells != UNKNOWN))
    figure = charts.new_figure(charts.plan_height_in(drawn, most=8.0))
    axes = figure.add_subplot()
    draw_free_space(axes, sheet)
    if walls is not None:
        for points, colour, label in ((walls.came_m, _CAME, "wall came"), (walls.went_m, _WENT, "wall went")):
            if len(points):
                axes.plot(*points.T, ".", color=colour, markersize=_MARK_PT, label=label)
    _names(axes, topology, level, several=several)
    if len(drawn):
        low, high = drawn.min(axis=0) - _MARGIN_M, drawn.max(axis=0) + _MARGIN_M
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    if axes.get_legend_handles_labels()[0]:
        charts.legend_above(axes)
    return figure


def _names(axes: Axes, topology: TopologicalMap, level: int, *, several: bool) -> None:
    for node in topology.intersections:
        if not several or str(node.level) == str(level):
            x, y = node.pose_map_node[:2]
            axes.text(x, y, node.name, fontsize=7, ha="center", va="center", clip_on=True)
    for tunnel in topology.tunnels:
        if not several:
            x, y = tunnel.line_m[len(tunnel.line_m) // 2, :2]
            axes.text(x, y, tunnel.name, fontsize=7, ha="center", va="center", clip_on=True)
