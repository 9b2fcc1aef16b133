"""The parts of a topological map on a plan: free space, centre lines, intersections, points, connections, closures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.data import ClosureRow
from lhdmap.report.labels import Label, placed
from lhdmap.report.topology_levels import coarser
from lhdmap.topology.model import AccessPoint, Intersection, Tunnel, Waypoint
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GREY = "#8a949e"
NODE, POINT, CLOSED = "#f0c419", charts.TRUTH, charts.WHEELS
KINDS: dict[str, tuple[str, str]] = {
    "driven": (charts.FINAL, "-"),
    "seen": (charts.ODOMETRY, "--"),
    "closed": (CLOSED, (0, (1.0, 1.0))),  # type: ignore[dict-item]  # dots, in matplotlib's words
}
KIND_WORDS = {"driven": "tunnel, driven", "seen": "tunnel, only seen", "closed": "tunnel, closed"}
SYMBOLS = {
    "draw_point": "^",
    "dump": "v",
    "park": "s",
    "turning_bay": "D",
    "passing_bay": "p",
    "pass": "o",
    "stop": "h",
}
MOST_VERTICES, MOST_OUTLINE, MOST_MARKS, MOST_LABELS = 20_000, 40, 4000, 300
_LONGEST_IMAGE = 900  # cells
_ARROW_PT, _SHAFT_PT = 9.0, 1.1
_STEP_PT = 2.0
_MARK = np.stack(np.meshgrid(*[np.arange(-4.0, 4.5)] * 2), axis=-1).reshape(-1, 2)  # as wide as a mark is


def kind_of(tunnel: Tunnel) -> str:
    """Return whether a tunnel is `driven`, only `seen`, or `closed`."""
    return "closed" if tunnel.closed else "driven" if tunnel.driven else "seen"


def draw_free_space(axes: Axes, sheet: Sheet, strength: float = 1.0) -> None:
    """Draw the free space in light grey, walls in dark grey; large sheets in coarser cells, of which the wall shows."""
    cells, (x, y), step_m = coarser(sheet, _LONGEST_IMAGE)[:3]
    picture = np.zeros((*cells.shape, 4), dtype=np.uint8)
    picture[..., :3] = (138, 148, 158)
    picture[..., 3] = np.select([cells == FREE, cells == OCCUPIED], [round(70 * strength), round(215 * strength)], 0)
    rows, columns = cells.shape
    extent = (float(x), float(x) + columns * step_m, float(y), float(y) + rows * step_m)
    axes.imshow(picture, extent=extent, origin="lower", interpolation="nearest", zorder=0.5)


def draw_lines(axes: Axes, lines_m: Sequence[FloatArray], colour: str, style: Any, label: str, **more: Any) -> None:
    """Draw lines (N, 2 or more) as one, thinned where they have very many points; nothing where there is none."""
    if not lines_m:
        return
    most = max(2, MOST_VERTICES // len(lines_m))
    gap = np.full((1, 2), np.nan)
    thin = [line[charts.thinned(len(line), most), :2] for line in lines_m]
    x, y = np.vstack([part for line in thin for part in (line, gap)]).T
    axes.plot(x, y, linestyle=style, color=colour, label=label, **more)


def draw_intersections(axes: Axes, nodes: Sequence[Intersection]) -> None:
    """Draw the free space of intersections."""
    from matplotlib.collections import PolyCollection

    most = max(MOST_OUTLINE, MOST_VERTICES // max(len(nodes), 1))
    outlines = [one.outline_m[charts.thinned(len(one.outline_m), most)] for one in nodes[:MOST_MARKS]]
    if outlines:
        shapes = PolyCollection(
            [outline for outline in outlines if len(outline)],
            facecolors=NODE + "70",
            edgecolors=NODE,
            linewidths=1.0,
            zorder=1.5,
            label="intersection",
        )
        axes.add_collection(shapes, autolim=False)


def draw_arrows(axes: Axes, poses: Sequence[FloatArray], colour: str, label: str, **size_pt: float) -> None:
    """Draw poses (4,) as arrows of one length on the page, from the place in the direction; `length`, `shaft` in points."""
    if not len(poses):
        return
    x, y, _, yaw = np.array(poses[:MOST_MARKS]).T
    length, shaft = size_pt.get("length", _ARROW_PT), size_pt.get("shaft", _SHAFT_PT)
    axes.quiver(
        x, y, np.cos(yaw), np.sin(yaw), angles="xy", scale_units="inches", scale=72.0 / length, units="inches",
        width=shaft / 72.0, headwidth=3.6, headlength=3.6, headaxislength=3.2, color=colour, zorder=3.0,
    )  # fmt: skip
    axes.plot([], [], linestyle="none", marker=r"$\rightarrow$", color=colour, markersize=8, label=label)


def draw_access_points(axes: Axes, points: Sequence[AccessPoint]) -> None:
    """Draw access points as small arrows that face outward."""
    draw_arrows(axes, [one.pose for one in points], charts.INK, "access point")


def draw_waypoints(axes: Axes, points: Sequence[Waypoint]) -> None:
    """Draw waypoints: the symbol says the purpose, the line the heading."""
    draw_headings(axes, [one.pose for one in points], POINT)
    for purpose, symbol in SYMBOLS.items():
        own = [one.pose[:2] for one in points[:MOST_MARKS] if one.purpose == purpose]
        draw_marks(axes, own, symbol, POINT, purpose.replace("_", " "), markersize=6.5)


def draw_headings(axes: Axes, poses: Sequence[FloatArray], colour: str) -> None:
    """Draw a short line in the direction of each pose (4,)."""
    if len(poses):
        x, y, _, yaw = np.array(poses[:MOST_MARKS]).T
        axes.quiver(
            x, y, np.cos(yaw), np.sin(yaw), angles="xy", scale_units="inches", scale=72.0 / 10.0, units="inches",
            width=1.4 / 72.0, headwidth=0.0, headlength=0.0, headaxislength=0.0, color=colour, zorder=3.4,
        )  # fmt: skip


def draw_marks(axes: Axes, points_m: Sequence[FloatArray], marker: str, colour: str, label: str, **more: Any) -> None:
    """Draw a mark at each point (2 or more,); nothing where there is none."""
    if len(points_m):
        x, y = np.array([point[:2] for point in points_m[:MOST_MARKS]]).T
        axes.plot(x, y, linestyle="none", marker=marker, color=colour, label=label, **({"zorder": 3.5} | more))


def draw_closures(axes: Axes, closures: Iterable[ClosureRow]) -> None:
    """Draw loop closures as thin lines between the two places; of those refused the ones that were measured."""
    rows = [one for one in closures if one.accepted or math.isfinite(one.residual_m)][:MOST_MARKS]
    for accepted, colour, style, words in (
        (True, charts.TRUTH, "-", "loop closure"),
        (False, charts.FLAGGED, ":", "loop closure, refused"),
    ):
        lines = [np.array([one.from_m[:2], one.to_m[:2]]) for one in rows if one.accepted == accepted]
        draw_lines(axes, lines, colour, style, words, linewidth=0.8, zorder=2.2)


def draw_labels(axes: Axes, labels: Sequence[tuple[str, FloatArray, float]], drawn_m: Sequence[FloatArray]) -> int:
    """Write names (text, place in metres, radius of its mark in points) where they cover nothing; return how many had no room.

    `drawn_m`: lines (N, 2 or more) that the names are to keep off.
    """
    scale = 72.0 / axes.figure.dpi
    corner = np.array(axes.bbox.min)

    def to_points(points_m: FloatArray) -> FloatArray:
        on_page: FloatArray = (axes.transData.transform(points_m[:, :2]) - corner) * scale
        return on_page

    wanted = [Label(text, to_points(at[None])[0], mark) for text, at, mark in labels[:MOST_LABELS]]
    drawn = np.vstack([_covered(to_points(line)) for line in drawn_m if len(line)] or [np.empty((0, 2))])
    found = placed(wanted, drawn, (float(axes.bbox.width * scale), float(axes.bbox.height * scale)))
    for one in found:
        label = wanted[one.number]
        (x, y), (at_x, at_y) = one.middle - label.at, labels[one.number][1][:2]
        line = {"arrowstyle": "-", "color": charts.INK, "linewidth": 0.5, "alpha": 0.55, "shrinkA": 0, "shrinkB": 1}
        axes.annotate(
            label.text, (at_x, at_y), (x, y), textcoords="offset points", ha="center", va="center", fontsize=label.size,
            arrowprops=line if one.apart else None, zorder=5.0, annotation_clip=True, parse_math=False,
        )  # fmt: skip
    return len(labels) - len(found)


def _covered(line: FloatArray) -> FloatArray:
    """Return points (M, 2) close together along a line (N, 2) on the page; of a single point, those of its mark."""
    if len(line) == 1:
        return line + _MARK
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    wanted = np.arange(0.0, at[-1] + _STEP_PT, _STEP_PT)
    return np.column_stack([np.interp(wanted, at, line[:, k]) for k in (0, 1)])
