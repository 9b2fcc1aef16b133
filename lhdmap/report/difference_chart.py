"""The picture of a difference report: walls that came in red, that went in blue, the rest of the map in grey."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet
from lhdmap.update.difference import Walls

_CAME, _WENT, _FREE, _WALL = "#c62828", "#1565c0", (0.93, 0.93, 0.93), (0.45, 0.45, 0.45)


def difference_svg(topology: TopologicalMap, sheets: Sequence[Sheet], walls: Sequence[Walls]) -> str:
    """Return an SVG with one picture a level."""
    from matplotlib.figure import Figure

    count = max(len(sheets), 1)
    figure = Figure(figsize=(8.0, 6.0 * count))
    for number, sheet in enumerate(sheets):
        axes = figure.add_subplot(count, 1, number + 1)
        image = np.ones((*sheet.cells.shape, 3))
        image[sheet.cells == FREE] = _FREE
        image[sheet.cells == OCCUPIED] = _WALL
        x, y = sheet.origin_m
        extent = (x, x + sheet.cells.shape[1] * sheet.cell_m, y, y + sheet.cells.shape[0] * sheet.cell_m)
        axes.imshow(image, origin="lower", extent=extent, interpolation="nearest")
        if number < len(walls):
            for points, colour, name in (
                (walls[number].came_m, _CAME, "wall came"),
                (walls[number].went_m, _WENT, "wall went"),
            ):
                if len(points):
                    axes.plot(points[:, 0], points[:, 1], ".", color=colour, markersize=2.5, label=name)
        for node in topology.intersections:
            if str(node.level) in (str(number), "") or count == 1:
                axes.text(node.T_map_node[0], node.T_map_node[1], node.name, fontsize=7, ha="center", va="center")
        axes.set_aspect("equal")
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper right", fontsize=8)
    figure.tight_layout()
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg")
    return buffer.getvalue()
