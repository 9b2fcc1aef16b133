"""The report of a localization: the way on the map by status, and over time how sure it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.localization.rows import CANDIDATE, LOST, TRACKING, Row
from lhdmap.report import charts, markup
from lhdmap.report.topology_drawing import draw_free_space
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet

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
        body = markup.cards(_cards(summary))
        if warnings:
            body += markup.section("Warnings", markup.listed(warnings, "warnings"))
        every = max(len(rows) // _MOST, 1)
        way, sure = _map(topology, sheets, rows[::every]), _sure(rows[::every])
        body += markup.section("On the map", markup.picture(way, "where the machine was, by status"))
        body += markup.section("How sure", markup.picture(sure, "standard deviations along and across, over time"))
        path.write_text(markup.document(title, body), encoding="utf-8")


def _cards(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return the figures with their units and what they mean."""
    fix, way = summary["first_fix_s"], summary["first_fix_m"]
    latency = summary["latency_ms"]
    return [
        ("tracked", f"{100.0 * summary['tracking_share']:.1f} %", f"of {summary['scans']} scans"),
        ("first fix", "none" if fix is None else f"{fix:.1f} s", "" if way is None else f"after {way:.1f} m"),
        ("lost", str(summary["lost_stretches"]), "stretches"),
        ("places withheld", str(summary["false_fix_guard"]), "found, and not sure enough or refused by the walls"),
        ("a scan", f"{latency['median']:.1f} ms", f"median; 99 % take at most {latency['p99']:.1f} ms"),
    ]


def _map(topology: TopologicalMap, sheets: Sequence[Sheet], rows: Sequence[Row]) -> str:
    figure = charts.new_figure(5.0)
    axes = figure.add_subplot()
    for sheet in sheets:
        draw_free_space(axes, sheet)
    for status, colour in ((TRACKING, charts.FINAL), (CANDIDATE, charts.WHEELS), (LOST, charts.FLAGGED)):
        at = np.array([[row.x_m, row.y_m] for row in rows if row.status == status]).reshape(-1, 2)
        if len(at):
            axes.plot(at[:, 0], at[:, 1], ".", markersize=2.5, color=colour, label=status)
    for node in topology.intersections:
        axes.text(node.T_map_node[0], node.T_map_node[1], node.name, fontsize=7, ha="center")
    for tunnel in topology.tunnels:
        x, y = tunnel.line_m[len(tunnel.line_m) // 2, :2]
        axes.text(x, y, tunnel.name, fontsize=7, ha="center")
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
    axes.set(xlabel="time, s", ylabel="standard deviation, mm", yscale="log", xlim=(0.0, max(float(seconds[-1]), 1.0)))
    charts.legend_above(axes)
    return charts.svg_uri(figure)
