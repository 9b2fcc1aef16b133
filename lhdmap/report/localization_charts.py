"""Charts of a localization: the way on the map, how sure it was over time, latency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING, UNKNOWN, LocalizationRow
from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.localization_data import LocalizationData
from lhdmap.report.topology_drawing import draw_free_space

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = {TRACKING: charts.FINAL, CANDIDATE: charts.WHEELS, LOST: charts.FLAGGED}
_STATUS = (UNKNOWN, LOST, CANDIDATE, TRACKING)
_MOST_CANDIDATES = 400
_SHOWN_FROM = 0.02  # of probability


def drawn_map(data: LocalizationData, rows: Sequence[LocalizationRow]) -> str:
    """Return the map with the way, the places that searches found, and what has changed, as a data URI."""
    lines = [tunnel.line_m for tunnel in data.topology.tunnels]
    figure = charts.new_figure(charts.plan_height_in(np.vstack(lines)) + 0.8 if lines else 5.0)
    axes = figure.add_subplot()
    for sheet in data.sheets:
        draw_free_space(axes, sheet)
    _draw_candidates(axes, data)
    for status, colour in _COLOURS.items():
        at = np.array([[row.x_m, row.y_m] for row in rows if row.status == status]).reshape(-1, 2)
        if len(at):
            axes.plot(at[:, 0], at[:, 1], ".", markersize=2.5, color=colour, label=status)
    weak = np.array([one.at_m for one in data.episodes if one.kind in ("weak", LOST)]).reshape(-1, 2)
    if np.isfinite(weak).any():
        axes.plot(weak[:, 0], weak[:, 1], "v", color=charts.FLAGGED, markersize=6, label="weak or lost from here")
    if data.changes:
        at = np.array([one.at_m for one in data.changes])
        axes.plot(at[:, 0], at[:, 1], "X", color=charts.WHEELS, markersize=8, label="not as in the map")
    for node in data.topology.intersections:
        axes.text(node.pose_map_node[0], node.pose_map_node[1], node.name, fontsize=7, ha="center")
    for tunnel in data.topology.tunnels:
        x, y = tunnel.line_m[len(tunnel.line_m) // 2, :2]
        axes.text(x, y, tunnel.name, fontsize=7, ha="center")
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    charts.legend_above(axes, 4)
    return charts.svg_uri(figure)


def _draw_candidates(axes: Axes, data: LocalizationData) -> None:
    """Draw the places that searches for the start, or after a loss, found."""
    found = [one for said in data.searches if said.purpose == "find" for one in said.candidates]
    shown = [one for one in found if one.probability >= _SHOWN_FROM]
    shown = shown[:: max(len(shown) // _MOST_CANDIDATES, 1)]
    if shown:
        at = np.array([one.pose[:2] for one in shown])
        sizes = [8.0 + 60.0 * one.probability for one in shown]
        axes.scatter(at[:, 0], at[:, 1], sizes, facecolors="none", edgecolors=charts.ODOMETRY, label="places found")


def drawn_sure(rows: Sequence[LocalizationRow]) -> str:
    """Return status, deviations and probability over time as a data URI."""
    figure = charts.new_figure(5.4)
    status, sure, likely = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [1.0, 2.4, 1.0]})
    seconds = _seconds(rows)
    status.step(seconds, [_STATUS.index(row.status) for row in rows], where="post", color=charts.TRUTH)
    status.set(yticks=range(len(_STATUS)), yticklabels=_STATUS, ylim=(-0.3, 3.3))
    status.tick_params(axis="y", labelsize=7)
    for name, scale, colour, label in (
        ("std_along_m", 1e3, charts.FINAL, "along, mm"),
        ("std_across_m", 1e3, charts.ODOMETRY, "across, mm"),
        ("std_heading_rad", 1e3, charts.TRUTH, "heading, mrad"),
    ):
        values = scale * np.array([getattr(row, name) for row in rows])
        sure.plot(*charts.envelope(seconds, values), color=colour, label=label, linewidth=1.0)
    sure.set(ylabel="standard deviation", yscale="log")
    sure.legend(loc="upper right", ncols=3)
    likely.plot(seconds, [row.probability for row in rows], color=charts.FLAGGED, linewidth=1.0)
    likely.set(xlabel="time, s", ylabel="probability", ylim=(-0.05, 1.05), xlim=(0.0, max(float(seconds[-1]), 1.0)))
    return charts.svg_uri(figure)


def drawn_latency(rows: Sequence[LocalizationRow]) -> str:
    """Return what a scan took over time as a data URI."""
    figure = charts.new_figure(2.4)
    axes = figure.add_subplot()
    seconds, latency = _seconds(rows), np.maximum(np.array([row.latency_ms for row in rows]), 1e-2)
    parts = np.array_split(np.arange(len(rows)), min(len(rows), 300))
    middles = np.array([seconds[part].mean() for part in parts])
    axes.plot(middles, [float(np.median(latency[part])) for part in parts], color=charts.FINAL, label="median")
    axes.plot(
        middles, [float(latency[part].max()) for part in parts], color=charts.WHEELS, label="largest", linewidth=0.8
    )
    axes.set(xlabel="time, s", ylabel="ms", yscale="log", xlim=(0.0, max(float(seconds[-1]), 1.0)))
    charts.legend_above(axes)
    return charts.svg_uri(figure)


def _seconds(rows: Sequence[LocalizationRow]) -> FloatArray:
    began = rows[0].stamp_ns
    return np.array([(row.stamp_ns - began) * 1e-9 for row in rows])
