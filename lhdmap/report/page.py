"""The HTML page of a run: one file, no network, readable on light and dark ground and in print."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path

from lhdmap.report import charts, cloud_charts, path_charts, series_charts, text
from lhdmap.report.data import ReportData, TopicRow

FLAGGED_NOTE = (
    "Information is what the scan alone says about the motion: ten times more is a standard deviation three times "
    "smaller. In a smooth drift the value along the machine falls, because walls look the same everywhere. Where a "
    "direction was not observed (shaded), its motion came from the wheels or the last motion."
)


def write_report(data: ReportData, path: Path) -> None:
    """Render the page into a file."""
    path.write_text(render_report(data), encoding="utf-8")


def render_report(data: ReportData) -> str:
    """Return the page as text; all pictures are in it."""
    with charts.styled():
        sections = [
            _section("What was found", _headline(data)),
            _section("Warnings", _warnings(data)),
            _section("Path", _path(data)),
            _section("Against the truth", _truth(data)),
            _section("Cloud", _cloud(data)),
            _section("Speed and slip", _speed(data)),
            _section("Information over the drive", _information(data)),
            _section("What was in the log", _topics(data.topics)),
            _section("How it was made", _provenance(data)),
        ]
    style = resources.files("lhdmap.report").joinpath("style.css").read_text(encoding="utf-8")
    title = html.escape(data.title)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{''.join(sections)}</body>\n</html>\n"
    )


def _section(title: str, body: str) -> str:
    return f"<section>\n<h2>{title}</h2>\n{body}</section>\n" if body else ""


def _headline(data: ReportData) -> str:
    cards = "".join(
        f"<div class=card><b>{html.escape(figure.value)}</b><span>{html.escape(figure.name)}</span>"
        f"<p>{html.escape(figure.meaning)}</p></div>\n"
        for figure in text.headline(data)
    )
    return f"<div class=cards>\n{cards}</div>\n"


def _warnings(data: ReportData) -> str:
    warnings = _list(data.warnings, "warning") if data.warnings else "<p>None.</p>\n"
    return warnings + _list(text.missing_parts(data), "missing")


def _list(items: Iterable[str], kind: str) -> str:
    rows = "".join(f"<li>{html.escape(item)}</li>\n" for item in items)
    return f"<ul class={kind}>\n{rows}</ul>\n" if rows else ""


def _path(data: ReportData) -> str:
    above = "Path of base_link (middle of the front axle) from above."
    plan = _picture(charts.svg_uri(path_charts.plan_chart(data)), above)
    if not data.has_inclinometer:
        return plan
    side = "Height of base_link over the distance driven; the scales differ."
    return plan + _picture(charts.svg_uri(path_charts.profile_chart(data)), side)


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
    table = _table(("segment, m", "how many", "translation, %", "rotation, °/m"), rows, numbers_from=0)
    return _picture(charts.svg_uri(path_charts.error_chart(found.profile)), caption) + table


def _cloud(data: ReportData) -> str:
    if data.cloud is None or not len(data.cloud.points_m):
        return "<p>No cloud was integrated.</p>\n"
    points, path = data.cloud.points_m, data.trajectory.positions_m
    flat = cloud_charts.is_flat(points)
    caption = f"{len(points)} points from above" + (", all at one height." if flat else ", coloured by height.")
    above = _picture(charts.svg_uri(cloud_charts.above_chart(points, path)), caption)
    if flat:
        return above
    side = "The same from the side, unrolled along the path; brighter cells hold more points. The scales differ."
    return above + _picture(charts.svg_uri(cloud_charts.side_chart(points, path)), side)


def _speed(data: ReportData) -> str:
    if data.odometry_speed is None and data.tachometer_speed is None:
        return "<p>No speed was recorded.</p>\n"
    caption = "Speed of the machine by odometry" + (
        " and by the tachometer; slip is how much faster the wheels turn than the machine moves."
        if data.tachometer_speed is not None
        else ". The log has no tachometer, so slip is not known."
    )
    return _picture(charts.svg_uri(series_charts.speed_chart(data)), caption)


def _information(data: ReportData) -> str:
    if data.diagnostics is None or not len(data.diagnostics.stamp_ns):
        return "<p>No diagnostics were recorded.</p>\n"
    return _picture(charts.svg_uri(series_charts.information_chart(data, data.diagnostics)), FLAGGED_NOTE)


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
    return _table(("topic", "type", "messages", "Hz", "remark"), rows, numbers_from=2, numbers_to=4)


def _provenance(data: ReportData) -> str:
    parts = _table(("", ""), list(data.provenance.items())) if data.provenance else ""
    settings = html.escape(data.settings_text)
    return parts + (f"<details><summary>Settings used</summary><pre>{settings}</pre></details>\n" if settings else "")


def _table(
    head: Sequence[str], rows: Sequence[Sequence[object]], *, numbers_from: int = 99, numbers_to: int = 99
) -> str:
    """Return a table; columns from `numbers_from` to before `numbers_to` hold numbers and are set flush right."""

    def line(tag: str, cells: Sequence[object]) -> str:
        marked = (
            f"<{tag}{' class=number' if numbers_from <= i < numbers_to else ''}>{html.escape(str(cell))}</{tag}>"
            for i, cell in enumerate(cells)
        )
        return f"<tr>{''.join(marked)}</tr>\n"

    body = "".join(line("td", row) for row in rows)
    return f"<div class=table><table>\n{line('th', head) if any(head) else ''}{body}</table></div>\n"


def _picture(uri: str, caption: str) -> str:
    alt = html.escape(caption)
    return f'<figure><img src="{uri}" alt="{alt}"><figcaption>{alt}</figcaption></figure>\n'
