"""The topological map on the page: a picture of each level, tables of tunnels, intersections and waypoints, loop closures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from lhdmap.report import charts, markup
from lhdmap.report.data import ClosureRow, ReportData
from lhdmap.report.landmark_page import landmarks_section
from lhdmap.report.topology_charts import level_figure
from lhdmap.report.topology_drawing import kind_of
from lhdmap.report.topology_levels import DrawnLevel, Levels, counted, summary
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel

MOST_LEVELS, MOST_ROWS = 12, 400
_MOST_REASONS = 6
_FOLDED = 12  # rows from which on a table is folded away
_STATE = {"driven": "driven", "seen": "only seen", "closed": "closed"}


def sections(data: ReportData) -> str:
    """Return the sections of the map as a graph, of loop closures and of landmarks; each is left out where there is none."""
    landmarks = "" if data.landmarks is None else landmarks_section(data, data.landmarks)
    return (
        markup.section("Topology", _topology(data))
        + markup.section("Loop closures", closures(data.closures))
        + markup.section("Landmarks", landmarks)
    )


def _topology(data: ReportData) -> str:
    if data.topology is None:
        return ""
    topology, levels = data.topology, Levels(data.topology, data.sheets)
    words = markup.paragraph(summary(topology, data.sheets)) + markup.listed(topology.remarks, "missing")
    if not topology.tunnels:
        return words
    return words + _pictures(topology, levels, data.closures) + _tables(topology)


def _pictures(topology: TopologicalMap, levels: Levels, found: Sequence[ClosureRow]) -> str:
    pictures = []
    for number, level in enumerate(levels.all[:MOST_LEVELS]):
        figure, left_out = level_figure(topology, levels, number, found)
        caption = f"{_named(level, several=len(levels.all) > 1)} Arrows at access points lead out of their node."
        if left_out:
            caption += f" {counted(left_out, 'name')} had no room here; the tables hold them."
        pictures.append(markup.picture(charts.svg_uri(figure), caption))
    if len(levels.all) > MOST_LEVELS:
        pictures.append(markup.paragraph(f"{len(levels.all) - MOST_LEVELS} more levels are not drawn."))
    return "".join(pictures)


def _named(level: DrawnLevel, *, several: bool) -> str:
    """Return what a picture of a level shows."""
    name = f"Level {level.name}, from above" if several else "From above"
    if level.sheet is None:
        return f"{name}."
    low, high = (round(height, 1) + 0.0 for height in level.sheet.heights_m)  # no -0.0
    return f"{name}; grey is free space{f', its floor at {low} to {high} m' if low < high else ''}."


def _tables(topology: TopologicalMap) -> str:
    names = {one.id: one.name for one in topology.nodes.values()}
    tunnels = [_tunnel_row(one, names) for one in topology.tunnels[:MOST_ROWS]]
    nodes = [(one.name, one.degree, one.level) for one in topology.intersections[:MOST_ROWS]]
    points = [
        (one.name, names.get(one.node, one.node), one.purpose.replace("_", " "))
        for one in topology.waypoints[:MOST_ROWS]
    ]
    head = ("tunnel", "ends", "", "length, m", "width min., m", "mean, m", "grade, %", "limit, km/h")
    return (
        _table("Tunnels", head, tunnels, len(topology.tunnels), 3)
        + _table("Intersections", ("intersection", "degree", "level"), nodes, len(topology.intersections), 1)
        + _table("Waypoints", ("waypoint", "in", "purpose"), points, len(topology.waypoints))
    )


def _tunnel_row(one: Tunnel, names: dict[str, str]) -> Sequence[object]:
    ends = " – ".join("dead end" if end == DEAD_END else names.get(end, end) for end in one.ends)
    widths = one.widths_m if len(one.half_widths_m) else np.array([np.nan])
    return (
        one.name,
        ends,
        _STATE[kind_of(one)],
        f"{one.length_m:.1f}",
        f"{widths.min():.2f}",
        f"{widths.mean():.2f}",
        f"{one.grade_max_pct:.1f}",
        f"{one.speed_limit_kmh:g}",
    )


def _table(
    title: str,
    head: Sequence[str],
    rows: Sequence[Sequence[object]],
    count: int,
    numbers_from: int = 99,
    numbers_to: int = 99,
    file: str = "topology.geojson",
) -> str:
    """Return a table with its title, a long one folded away; nothing where there are no rows. The `file` has all of them."""
    if not rows:
        return ""
    table = markup.table(head, rows, numbers_from=numbers_from, numbers_to=numbers_to)
    if count > len(rows):
        table += markup.paragraph(f"{count - len(rows)} more stand in {file}.")
    folded = "" if len(rows) > _FOLDED else " open"
    return f"<details{folded}><summary>{title} ({count})</summary>\n{table}</details>\n"


def closures(rows: Sequence[ClosureRow]) -> str:
    """Return what is known of places taken for ones seen before; where nothing was measured, the reason is counted."""
    if not rows:
        return ""
    accepted = sum(row.accepted for row in rows)
    reasons = Counter(row.reason for row in rows if not row.accepted).most_common(_MOST_REASONS)
    refused = "; ".join(f"{reason or 'no reason given'} ({count})" for reason, count in reasons)
    words = f"{accepted} of {counted(len(rows), 'candidate')} accepted{f'. Refused: {refused}' if refused else ''}."
    measured = [row for row in rows if row.accepted or math.isfinite(row.residual_m)]
    told = [
        (
            _place(row.from_m),
            _place(row.to_m),
            _figure(100.0 * row.residual_m, ".1f"),
            _figure(row.information, ".2g"),
            "yes" if row.accepted else "no",
            row.reason,
        )
        for row in measured[:MOST_ROWS]
    ]
    head = ("first: x y z, m", "later: x y z, m", "residual, cm", "information, 1/m²", "accepted", "reason")
    return markup.paragraph(words) + _table("Measured", head, told, len(measured), 0, 5, "closures.json")


def _figure(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"


def _place(point_m: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{value:.1f}" for value in point_m[:3])
