"""The HTML page of a run: one file, no network, readable on light and dark ground and in print."""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lhdmap.report import (
    charts,
    cloud_charts,
    difference_page,
    glossary,
    markup,
    path_charts,
    pile_page,
    series_charts,
    text,
    topology_page,
)
from lhdmap.report.data import ReportData, TopicRow

DEVIATION_NOTE = (
    "How well each scan alone fixes the machine's motion: one standard deviation, smaller is better; what goes beyond the top "
    "of the scale is drawn at its edge. In a smooth drift the deviation along the machine rises, because walls look the same "
    "everywhere. Where a direction was not observed (shaded), {}."
)
COST = "<!-- cost -->"
_COST_WORDS = "real time"  # that will stand there


def write_report(data: ReportData, path: Path) -> None:
    """Render the page into a file."""
    path.write_text(render_report(data), encoding="utf-8")


def render_report(data: ReportData) -> str:
    """Return the page as text; all pictures are in it."""
    with charts.styled():
        sections = [
            markup.section("What was found", _headline(data)),
            markup.section("Warnings", _warnings(data)),
            difference_page.section(data),
            markup.section("Path", _path(data)),
            markup.section("Against the truth", _truth(data)),
            markup.section("Cloud", _cloud(data)),
            topology_page.sections(data),
            _pile(data),
            *_of_odometry(data),
            markup.section("What was in the log", _topics(data.topics)),
            markup.section("How it was made", _provenance(data)),
        ]
    body = "".join(sections)
    return markup.document(
        data.title, body + markup.section("Words", glossary.list_of(body.replace(COST, _COST_WORDS)))
    )


def fill_in_cost(path: Path, figures: Mapping[str, Any]) -> None:
    """Put what a run cost (names of `build-map --json`) into its page: it is known only once all else is written."""
    cards = markup.card_list(_cards(text.cost_figures(text.summary_of(figures))))
    path.write_text(path.read_text(encoding="utf-8").replace(COST, cards, 1), encoding="utf-8")


def _headline(data: ReportData) -> str:
    known = data.summary.realtime_factor is not None
    figures = [*text.headline(data), *(text.cost_figures(data.summary) if known else ())]
    return markup.cards(_cards(figures), "" if known else COST)


def _cards(figures: Iterable[text.Figure]) -> Iterator[tuple[str, str, str]]:
    return ((figure.name, figure.value, figure.meaning) for figure in figures)


def _pile(data: ReportData) -> str:
    if data.pile is None:
        return pile_page.unsought_section(data.pile_reason) if data.pile_reason else ""
    return pile_page.pile_sections(data.pile, said=data.warnings)


def _of_odometry(data: ReportData) -> list[str]:
    """Return the sections of how the motion was found; where poses were given, it was not; of two drives, each map has its own."""
    if data.poses or data.difference is not None:
        return []
    return [
        markup.section("Speed and slip", _speed(data)),
        markup.section("How well the scans fix the motion", _deviations(data)),
    ]


def _warnings(data: ReportData) -> str:
    warnings = markup.listed(data.warnings, "warning") if data.warnings else "<p>None.</p>\n"
    return warnings + markup.listed(text.missing_parts(data), "missing")


def _path(data: ReportData) -> str:
    above = "Path of base_link (middle of the front axle) from above."
    plan = markup.picture(charts.svg_uri(path_charts.plan_chart(data)), above)
    if not (data.has_inclinometer or data.poses):
        return plan
    side = "Height of base_link over the distance driven; the scales differ."
    return plan + markup.picture(charts.svg_uri(path_charts.profile_chart(data)), side)


def _truth(data: ReportData) -> str:
    found = data.evaluation
    if found is None:
        return ""
    caption = (
        f"Position error in the true heading frame, alignment {found.alignment}, {found.pairs} pairs; the end is off "
        "by "
        + ("an unknown share" if found.end_pct is None else f"{found.end_pct:.3f} % of the distance")
        + f". The estimate covers {100 * found.reach:.1f} % of the true path."
    )
    rows = [
        (
            f"{s.length_m:g}",
            s.n,
            "none" if s.translation_pct is None else f"{s.translation_pct:.4f}",
            "none" if s.rotation_deg_per_m is None else f"{s.rotation_deg_per_m:.5f}",
        )
        for s in found.segments
    ]
    table = markup.table(("segment, m", "how many", "translation, %", "rotation, °/m"), rows, numbers_from=0)
    return markup.picture(charts.svg_uri(path_charts.error_chart(found.profile)), caption) + table


def _cloud(data: ReportData) -> str:
    if data.cloud is None or not len(data.cloud.points_m):
        return "<p>No cloud was integrated.</p>\n"
    points, path = data.cloud.points_m, data.trajectory.positions_m
    flat = cloud_charts.is_flat(points)
    caption = f"{len(points)} points from above" + (", all at one height." if flat else ", coloured by height.")
    above = markup.picture(charts.svg_uri(cloud_charts.above_chart(points, path)), caption)
    if flat:
        return above
    side = "The same from the side, unrolled along the path; brighter cells hold more points. The scales differ."
    return above + markup.picture(charts.svg_uri(cloud_charts.side_chart(points, path)), side)


def _speed(data: ReportData) -> str:
    if data.odometry_speed is None and data.tachometer_speed is None:
        return "<p>No speed was recorded.</p>\n"
    caption = "Speed of the machine by odometry" + (
        " and by the tachometer; slip is how much faster the wheels turn than the machine moves, drawn where one of them does."
        if data.tachometer_speed is not None
        else ". The log has no tachometer, so slip is not known."
    )
    return markup.picture(charts.svg_uri(series_charts.speed_chart(data)), caption)


def _deviations(data: ReportData) -> str:
    if data.diagnostics is None or not len(data.diagnostics.stamp_ns):
        return "<p>No diagnostics were recorded.</p>\n"
    note = DEVIATION_NOTE.format(text.weak_motion(data.witness))
    return markup.picture(charts.svg_uri(series_charts.deviation_chart(data, data.diagnostics)), note)


def _topics(topics: Sequence[TopicRow]) -> str:
    rows = [
        (
            row.topic,
            row.type_name,
            "?" if row.messages is None else row.messages,
            "" if row.rate_hz is None else f"{row.rate_hz:.1f}",
            row.remark,
        )
        for row in topics
    ]
    return markup.table(("topic", "type", "messages", "Hz", "remark"), rows, numbers_from=2, numbers_to=4)


def _provenance(data: ReportData) -> str:
    parts = markup.table(("", ""), list(data.provenance.items())) if data.provenance else ""
    settings = html.escape(data.settings_text)
    return parts + (f"<details><summary>Settings used</summary><pre>{settings}</pre></details>\n" if settings else "")
