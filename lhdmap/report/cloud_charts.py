"""Charts of the cloud: from above, and from the side unrolled along the path; drawn as small images."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.poses import distances_along
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.report import charts
from lhdmap.report.charts import Reals
from lhdmap.report.path_charts import plan_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST_IMAGE_PX = 1100
PATH_STEP_M = 0.5
FLAT_M = 0.05


class Raster(NamedTuple):
    """An image over a rectangle: `values` (rows from the bottom, columns), NaN where empty; `extent` x0, x1, y0, y1."""

    values: FloatArray
    extent: tuple[float, float, float, float]


def is_flat(points_m: Float32Array) -> bool:
    """Return whether all points are at one height, as those of a level 2D scanner on a level floor are."""
    return float(np.ptp(points_m[:, 2])) < FLAT_M


def above_chart(points_m: Float32Array, path_m: FloatArray) -> Figure:
    """Draw the cloud from above, coloured by the mean height in each cell, with the path."""
    raster = mean_raster(points_m[:, 0], points_m[:, 1], points_m[:, 2], least_cell_m=0.1)
    flat = is_flat(points_m)
    figure = charts.new_figure(charts.plan_height_in(points_m, least=2.6), right_in=0.12 if flat else 0.85)
    axes = figure.add_subplot()
    low, high = np.nanpercentile(raster.values, [2, 98])
    if flat:  # one height takes the middle of the palette, which is seen on any ground
        low, high = low - 1.0, high + 1.0
    image = axes.imshow(
        raster.values,
        extent=raster.extent,
        origin="lower",
        cmap=_palette(),
        vmin=low,
        vmax=max(high, low + 0.1),
        interpolation="nearest",
    )
    rows = charts.thinned(len(path_m))
    axes.plot(path_m[rows, 0], path_m[rows, 1], color=charts.WHEELS, linewidth=1.0, label="path of base_link")
    plan_axes(axes)
    axes.grid(visible=False)
    if not flat:
        bar = figure.colorbar(image, cax=axes.inset_axes((1.012, 0.0, 0.016, 1.0)), label="height, m")
        bar.ax.grid(visible=False)
    charts.legend_above(axes)
    return figure


def side_chart(points_m: Float32Array, path_m: FloatArray) -> Figure:
    """Draw the cloud from the side: height over the distance along the path at the nearest point of it."""
    along, path_along, path_z = unrolled(points_m, path_m)
    raster = count_raster(along, points_m[:, 2])
    figure = charts.new_figure(2.8)
    axes = figure.add_subplot()
    axes.imshow(
        raster.values, extent=raster.extent, origin="lower", cmap=_palette(), aspect="auto", interpolation="nearest"
    )
    axes.plot(path_along, path_z, color=charts.WHEELS, linewidth=1.2, label="path of base_link (floor)")
    low, high = np.percentile(points_m[::7, 2], [0.1, 99.9])
    margin = 0.08 * max(high - low, 1.0)
    axes.set_ylim(min(low, path_z.min()) - margin, max(high, path_z.max()) + margin)
    axes.set(xlabel="distance along the path, m", ylabel="height, m")
    axes.grid(visible=False)
    charts.legend_above(axes)
    return figure


def _palette() -> Any:
    """Return viridis without its darkest part, which would vanish on dark ground."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(0.15, 1.0, 256)))


def unrolled(points_m: Float32Array, path_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each point's distance along the path (N,), and distance and height of the thinned path (K,), (K,).

    The nearest point of the path is looked up once for each square of 0.5 m, not for each point.
    """
    from scipy.spatial import cKDTree

    along = distances_along(path_m)
    steps = np.arange(0.0, along[-1] + PATH_STEP_M, PATH_STEP_M)
    rows = np.unique(np.minimum(np.searchsorted(along, steps), len(along) - 1))
    squares, shape, extent = _cells(points_m[:, 0], points_m[:, 1], PATH_STEP_M, PATH_STEP_M)
    used, square = np.unique(squares, return_inverse=True)
    centres = np.column_stack(
        [extent[0] + (used % shape[1] + 0.5) * PATH_STEP_M, extent[2] + (used // shape[1] + 0.5) * PATH_STEP_M]
    )
    nearest = cKDTree(path_m[rows, :2]).query(centres)[1][square]
    offset = points_m[:, :2] - path_m[rows[nearest], :2]
    ahead = np.gradient(path_m[rows, :2], axis=0) if len(rows) > 1 else np.tile([1.0, 0.0], (len(rows), 1))
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    return along[rows[nearest]] + np.einsum("ij,ij->i", offset, ahead[nearest]), along[rows], path_m[rows, 2]


def mean_raster(x: Reals, y: Reals, values: Reals, least_cell_m: float) -> Raster:
    """Return the mean of `values` in square cells over x and y, all (N,)."""
    cell = max(least_cell_m, float(max(np.ptp(x), np.ptp(y))) / LONGEST_IMAGE_PX)
    cells, shape, extent = _cells(x, y, cell, cell)
    size = shape[0] * shape[1]
    counts = np.bincount(cells, minlength=size)
    sums = np.bincount(cells, weights=values, minlength=size)
    means = np.divide(sums, counts, out=np.full(size, np.nan), where=counts > 0)
    return Raster(means.reshape(shape), extent)


def count_raster(x: Reals, y: Reals) -> Raster:
    """Return the logarithm of the count in cells over x and y (N,), which need not be square; NaN where empty."""
    cell_x, cell_y = max(0.2, float(np.ptp(x)) / 500), max(0.1, float(np.ptp(y)) / 90)
    cells, shape, extent = _cells(x, y, cell_x, cell_y)
    counts = np.bincount(cells, minlength=shape[0] * shape[1]).astype(float)
    return Raster(np.log1p(np.where(counts > 0, counts, np.nan)).reshape(shape), extent)


def _cells(
    x: Reals, y: Reals, cell_x: float, cell_y: float
) -> tuple[npt.NDArray[np.int64], tuple[int, int], tuple[float, float, float, float]]:
    x0, y0 = float(x.min()), float(y.min())
    column, row = ((x - x0) / cell_x).astype(np.int64), ((y - y0) / cell_y).astype(np.int64)
    shape = (int(row.max()) + 1, int(column.max()) + 1)
    extent = (x0, x0 + shape[1] * cell_x, y0, y0 + shape[0] * cell_y)
    return row * shape[1] + column, shape, extent
