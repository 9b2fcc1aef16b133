"""Fig. 10 of the autonomous loading paper: hits around the pile coloured by n_y, the part of the normal across the drift.

n_y is negative on the left wall, near zero on the pile and positive on the right wall: by it Fig. 9 removes the walls.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.integration.normals import estimate_normals
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileEstimate, PileReport
from lhdmap.report import charts
from lhdmap.report.pile_charts import Ahead

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = "coolwarm"  # low values blue, high values red, as in the paper
_RADIUS_M = 0.75  # Fig. 9
_VOXEL_M = 0.05  # hits nearer than this say the same
_EYE_M = np.array([-8.5, 0.0, 3.9])  # behind and above the machine, in the pile's frame
_AT_M = np.array([0.6, 0.0, 0.7])
_NEAREST_M = 3.0
_DOT = 30.0  # a mark's size in points at a depth of one metre
_HIGHEST_M = 3.2  # the roof would hide what lies under it
_REACH_M = (-3.6, 5.0)
_TRIAD_X_M, _TRIAD_M = -2.6, 0.9


class NormalCloud(NamedTuple):
    """Hits around the pile in the map (N, 3) and their n_y (N,) in the pile's frame, -1 to 1."""

    points_m: FloatArray
    across: FloatArray


def normal_cloud(report: PileReport, pile: PileEstimate) -> NormalCloud:
    """Return the hits around the pile that have a normal, which points to where the machine came from."""
    points = _thinned(np.concatenate([report.around_m, pile.face_m]))
    local = Ahead.of(pile).local(points)
    seen_from = np.column_stack([np.minimum(local[:, 0], 0.0) - 2.0, np.zeros(len(local)), np.full(len(local), 1.2)])
    normals = estimate_normals(local.astype(np.float32), _RADIUS_M, seen_from.astype(np.float32)).normals
    known = normals.any(axis=1)
    return NormalCloud(points[known], normals[known, 1].astype(np.float64))


def across_colours(across: FloatArray) -> npt.NDArray[np.uint32]:
    """Return 0xRRGGBBAA of n_y (N,)."""
    from matplotlib import colormaps

    share = colormaps[COLOURS](0.5 + 0.5 * across)
    r, g, b = (np.rint(255.0 * share[:, i]).astype(np.uint32) for i in range(3))
    return (r << 24 | g << 16 | b << 8 | 255).astype(np.uint32)


def normals_chart(report: PileReport, pile: PileEstimate) -> Figure:
    """Draw the cloud from behind and above the machine, coloured by n_y, with toe and limits."""
    frame, cloud = Ahead.of(pile), normal_cloud(report, pile)
    local = frame.local(cloud.points_m)
    shown = (local[:, 2] < _HIGHEST_M) & (local[:, 0] > _REACH_M[0]) & (local[:, 0] < _REACH_M[1])
    places, depth = _projected(local[shown])
    ahead = depth > _NEAREST_M
    order = np.flatnonzero(ahead)[np.argsort(-depth[ahead])]  # the nearer one is drawn over the farther
    figure = charts.new_figure(4.6, right_in=0.95)
    axes = figure.add_subplot()
    image = axes.scatter(
        places[order, 0],
        places[order, 1],
        s=(_DOT / depth[order]) ** 2,
        c=cloud.across[shown][order],
        cmap=COLOURS,
        vmin=-1.0,
        vmax=1.0,
        linewidths=0,
        rasterized=True,
    )
    _toe(axes, frame, pile)
    _triad(axes, frame.half_m)
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(False)
    bar = figure.colorbar(
        image, cax=axes.inset_axes((1.015, 0.05, 0.018, 0.9)), label="n_y: left wall -1, pile 0, right wall +1"
    )
    bar.ax.grid(visible=False)
    charts.legend_above(axes)
    return figure


def _toe(axes: Axes, frame: Ahead, pile: PileEstimate) -> None:
    """Draw the toe, and the limits with their names."""
    toe, _ = _projected(frame.local(pile.toe_m))
    axes.plot(*toe.T, color=charts.INK, linewidth=1.6, label="toe")
    ends, _ = _projected(frame.local(np.vstack([pile.left_limit_m, pile.right_limit_m])))
    axes.plot(*ends.T, "D", color=charts.INK, markersize=4.5, label="limits")
    for (x, y), name, shift in zip(ends, ("E_L", "E_R"), (6.0, -20.0), strict=True):
        axes.annotate(name, (x, y), (shift, -14.0), textcoords="offset points", fontsize=11.0)


def _triad(axes: Axes, half_m: float) -> None:
    """Draw the axes that n_y is said in, on the floor between machine and pile: x into the pile, y to the left, z up."""
    origin = np.array([_TRIAD_X_M, 0.3 * half_m, 0.0])
    length = min(_TRIAD_M, 0.6 * half_m)
    for name, axis in (("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])):
        (start, end), _ = _projected(np.vstack([origin, origin + length * np.array(axis)]))
        arrow = {"arrowstyle": "-|>", "color": charts.INK, "linewidth": 1.4, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", end, start, arrowprops=arrow, annotation_clip=False)
        x, y = end + 0.14 * (end - start)
        axes.text(x, y, name, ha="center", va="center", fontsize=10.0)


def _projected(local_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (N, 2) on a plane one unit before the eye, right and up, and depths (N,) of points (N, 3)."""
    forward = (_AT_M - _EYE_M) / np.linalg.norm(_AT_M - _EYE_M)
    right = np.array([forward[1], -forward[0], 0.0]) / math.hypot(forward[0], forward[1])
    up = np.cross(right, forward)
    d = local_m - _EYE_M
    depth = d @ forward
    safe = np.maximum(depth, 0.1)
    return np.column_stack([(d @ right) / safe, (d @ up) / safe]), depth


def _thinned(points_m: FloatArray) -> FloatArray:
    """Return one of the points (N, 3) in each small voxel."""
    _, first = np.unique(np.floor(points_m / _VOXEL_M).astype(np.int64), axis=0, return_index=True)
    return points_m[np.sort(first)]
