"""Charts for the page: matplotlib without a display, drawn as SVG that is readable on light and on dark ground."""

from __future__ import annotations

import base64
import importlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FINAL, ODOMETRY, TRUTH, WHEELS, FLAGGED = "#2f86c9", "#e69f00", "#009e73", "#d55e00", "#cc79a7"
"""Okabe and Ito's colours, which differ for colour-blind eyes too; the blue a little lighter for dark ground."""
WIDTH_IN = 9.4
_PNG_DPI = 150
Reals = npt.NDArray[np.floating[Any]]
INK = "#010203"
_STYLE = (
    "<style>svg{color:#24292f}@media (prefers-color-scheme:dark){svg{color:#d5d9de}}"
    "text{font-family:'DejaVu Sans',Verdana,sans-serif}</style>"
)
_SETTINGS: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "lhdmap",
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": INK,
    "grid.alpha": 0.15,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


def load() -> None:
    """Load what drawing needs, which takes a good part of a second: ahead of time, beside other work."""
    for name in ("matplotlib.backends.backend_svg", "matplotlib.figure", "scipy.spatial"):
        importlib.import_module(name)


def styled() -> Any:
    """Return a context in which figures get the style of the page."""
    import matplotlib as mpl

    return mpl.rc_context(_SETTINGS)


def new_figure(height_in: float, *, right_in: float = 0.12) -> Figure:
    """Return an empty figure of the page's width with fixed margins: fitting them takes as long as drawing."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, height_in))
    bottom, top = 0.48 / height_in, 1.0 - 0.28 / height_in
    figure.subplots_adjust(left=0.75 / WIDTH_IN, right=1.0 - right_in / WIDTH_IN, bottom=bottom, top=top, hspace=0.12)
    return figure


def svg_uri(figure: Figure) -> str:
    """Return the figure as a data URI; its ink follows the reader's light or dark setting."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg_text(figure).encode()).decode("ascii")


def svg_text(figure: Figure) -> str:
    """Return the figure as SVG; its ink follows the reader's light or dark setting."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue().replace(INK, "currentColor").replace("font-family: 'DejaVu Sans'", "")
    return svg[svg.index("<svg") :].replace("<defs>", _STYLE + "<defs>", 1)


def write_figure(figure: Figure, path: Path, kind: str) -> None:
    """Write a figure as `svg` or `png`, the latter on white ground."""
    if kind == "svg":
        path.write_text(svg_text(figure), encoding="utf-8")
    else:
        figure.savefig(path, format="png", dpi=_PNG_DPI, facecolor="white")


def plan_height_in(points_m: Reals, least: float = 2.2, most: float = 6.5) -> float:
    """Return the height in inches at which a plan of points (N, 2+) with equal scales fills the page's width."""
    spans = np.ptp(points_m[:, :2], axis=0) if len(points_m) else np.ones(2)
    return float(np.clip(0.9 * WIDTH_IN * spans[1] / max(spans[0], 1e-9) + 0.9, least, most))


def thinned(length: int, most: int = 1500) -> npt.NDArray[np.int64]:
    """Return at most about `most` evenly spaced rows of `length`, the last one included."""
    rows = np.arange(0, length, max(1, length // most))
    return np.append(rows, length - 1) if length and rows[-1] != length - 1 else rows


def envelope(x: FloatArray, y: FloatArray, bins: int = 700) -> tuple[FloatArray, FloatArray]:
    """Return x and y (N,) thinned so that the smallest and largest of each bin stay: no short dip is lost."""
    if len(x) <= 4 * bins:
        return x, y
    edges = np.linspace(0, len(x), bins + 1).astype(np.int64)[:-1]
    filled_low, filled_high = np.where(np.isnan(y), np.inf, y), np.where(np.isnan(y), -np.inf, y)
    low, high = np.minimum.reduceat(filled_low, edges), np.maximum.reduceat(filled_high, edges)
    values = np.column_stack([low, high]).ravel()
    return np.repeat(x[edges], 2), np.where(np.isfinite(values), values, np.nan)


def stretches(flags: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last row of each run of true flags (N,)."""
    steps = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(steps == 1).tolist(), (np.flatnonzero(steps == -1) - 1).tolist(), strict=True))


def shade(axes: Axes, x: FloatArray, flags: npt.NDArray[np.bool_], label: str) -> None:
    """Shade the flagged stretches; those closer than a pixel are drawn as one."""
    pixel = (x[-1] - x[0]) / 800 if len(x) > 1 else 1.0
    merged: list[list[float]] = []
    for first, last in stretches(flags):
        start, stop = float(x[first]), max(float(x[min(last + 1, len(x) - 1)]), float(x[first]) + pixel)
        if merged and start - merged[-1][1] <= pixel:
            merged[-1][1] = stop
        else:
            merged.append([start, stop])
    for number, (start, stop) in enumerate(merged):
        axes.axvspan(start, stop, color=FLAGGED, alpha=0.3, linewidth=0, label=label if number == 0 else None)


def legend_above(axes: Axes, columns: int = 4) -> None:
    """Put the legend above the axes, where it covers nothing."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2)
