"""The report of a localization: the way on the map by status, and over time how sure it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING, Row
from lhdmap.report import charts, markup
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import FREE, Sheet

_MOST = 3000


def write_localization_report(
    path: Path,
    drawn: tuple[str, TopologicalMap, Sequence[Sheet]],
    rows: Sequence[Row],
    summary: Mapping[str, Any],
    warnings: Sequence[str],
) -> None:
    """Write one self-contained page; `drawn`: its title, and the map with its levels."""
    title, topology, sheets = drawn
    with charts.styled():
        figures = [(key.replace("_", " "), _shown(value), "") for key, value in summary.items()]
        body = markup.cards(figures)
        if warnings:
            body += markup.section("Warnings", markup.listed(warnings, "warnings"))
        every = max(len(rows) // _MOST, 1)
        way, sure = _map(topology, sheets, rows[::every]), _sure(rows[::every])
        body += markup.section("On the map", markup.picture(way, "where the machine was, by status"))
        body += markup.section("How sure", markup.picture(sure, "standard deviations along and across, over time"))
        path.write_text(markup.document(title, body), encoding="utf-8")


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_shown(one)}" for key, one in value.items())
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _map(topology: TopologicalMap, sheets: Sequence[Sheet], rows: Sequence[Row]) -> str:
    figure = charts.new_figure(5.0)
    axes = figure.add_subplot()
    for sheet in sheets:
        cells = sheet.middles_m(np.argwhere(sheet.cells == FREE)[::7])
        axes.plot(cells[:, 0], cells[:, 1], ",", color=charts.INK, alpha=0.15)
    for status, colour in ((TRACKING, charts.FINAL), (CANDIDATE, charts.WHEELS), (LOST, charts.FLAGGED)):
        at = np.array([[row.x_m, row.y_m] for row in rows if row.status == status]).reshape(-1, 2)
        if len(at):
            axes.plot(at[:, 0], at[:, 1], ".", markersize=2.5, color=colour, label=status)
    for node in topology.intersections:
        axes.text(node.T_map_node[0], node.T_map_node[1], node.name, fontsize=7, ha="center")
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    charts.legend_above(axes)
    return charts.svg_uri(figure)


def _sure(rows: Sequence[Row]) -> str:
    figure = charts.new_figure(3.0)
    axes = figure.add_subplot()
    began = rows[0].stamp_ns
    seconds = np.array([(row.stamp_ns - began) * 1e-9 for row in rows])
    for name, colour in (("std_along_m", charts.FINAL), ("std_across_m", charts.ODOMETRY)):
        axes.plot(seconds, [1e3 * getattr(row, name) for row in rows], color=colour, label=name[4:-2], linewidth=1.0)
    axes.set(xlabel="time, s", ylabel="standard deviation, mm", ylim=(0.0, None))
    charts.legend_above(axes)
    return charts.svg_uri(figure)
