"""The report of a localization: the way on the map by status, where it was weak or lost and why, what has changed, how sure."""

from __future__ import annotations

import math
from pathlib import Path

from lhdmap.report import charts, markup
from lhdmap.report.localization_charts import drawn_latency, drawn_map, drawn_sure
from lhdmap.report.localization_data import LocalizationData
from lhdmap.topology.model import TopologicalMap

_MOST, _MOST_LISTED = 3000, 60
_KINDS = {"came": "something stands there now", "went": "a wall is not there any more"}


def write_localization_report(path: Path, data: LocalizationData) -> None:
    """Write one self-contained page."""
    every = max(len(data.rows) // _MOST, 1)
    rows = data.rows[::every]
    with charts.styled():
        body = markup.cards(_cards(data))
        if data.warnings:
            body += markup.section("Warnings", markup.listed(data.warnings, "warnings"))
        caption = "Where the machine was, by status; circles are places that searches found, the larger the likelier."
        body += markup.section("On the map", markup.picture(drawn_map(data, rows), caption))
        body += markup.section("What is not as in the map", _changes(data))
        body += markup.section("Where it was weak or lost", _episodes(data))
        sure = "Status, standard deviations of the place and of the heading, and probability, over time."
        body += markup.section("How sure", markup.picture(drawn_sure(rows), sure))
        latency = "What localization took for a scan, beside the odometry: median and largest of each stretch."
        body += markup.section("Latency", markup.picture(drawn_latency(data.rows), latency))
    path.write_text(markup.document(data.title, body), encoding="utf-8")


def _cards(data: LocalizationData) -> list[tuple[str, str, str]]:
    """Return the figures with their units and what they mean."""
    summary = data.summary
    fix, way = summary["first_fix_s"], summary["first_fix_m"]
    latency = summary["latency_ms"]
    return [
        ("tracked", f"{100.0 * summary['tracking_share']:.1f} %", f"of {summary['scans']} scans"),
        ("first fix", "none" if fix is None else f"{fix:.1f} s", "" if way is None else f"after {way:.1f} m"),
        ("lost", str(summary["lost_stretches"]), "stretches"),
        ("places withheld", str(summary["false_fix_guard"]), "found, and not sure enough or refused by the walls"),
        ("changes", str(len(data.changes)), "stretches that are not as in the map"),
        ("a scan", f"{latency['median']:.1f} ms", f"median; 99 % take at most {latency['p99']:.1f} ms"),
    ]


def _changes(data: LocalizationData) -> str:
    """Return the changed stretches as a table, and the command that takes them over; nothing where there are none."""
    if not data.changes:
        return ""
    began = data.rows[0].stamp_ns
    rows = [
        (
            _name(data.topology, one.node),
            one.side or "around",
            f"{one.start_m:.1f} to {one.end_m:.1f}"
            if math.isfinite(one.start_m)
            else f"at {one.at_m[0]:.1f}, {one.at_m[1]:.1f}",
            f"{one.length_m:.1f}",
            f"{one.depth_m:.2f}",
            f"{(one.since_ns - began) * 1e-9:.1f}",
            _KINDS[one.kind],
        )
        for one in data.changes
    ]
    head = ("node", "side", "along it, m", "length, m", "off the walls, m", "seen since, s", "what")
    table = markup.table(head, rows, numbers_from=3, numbers_to=6)
    return table + markup.paragraph(f"To take this over into a new version of the map: {data.update}")


def _episodes(data: LocalizationData) -> str:
    if not data.episodes:
        return ""
    began = data.rows[0].stamp_ns
    rows = [
        (
            one.kind,
            f"{(one.from_ns - began) * 1e-9:.1f}",
            f"{(one.to_ns - one.from_ns) * 1e-9:.1f}",
            _name(data.topology, one.node),
            f"{one.rho_m:.1f}" if math.isfinite(one.rho_m) else "",
            one.why,
        )
        for one in data.episodes[:_MOST_LISTED]
    ]
    left = len(data.episodes) - len(rows)
    more = markup.paragraph(f"{left} more are left out.") if left else ""
    head = ("what", "from, s", "for, s", "node", "at, m", "why")
    return markup.table(head, rows, numbers_from=1, numbers_to=3) + more


def _name(topology: TopologicalMap, node: str) -> str:
    found = topology.nodes.get(node)
    return "" if found is None else found.name
