"""The page of a batch: how many logs, what failed and why, trends, and a line for each with a link to its report."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lhdmap.report import markup
from lhdmap.report.batch_trends import trend_section

_FIGURES = (
    ("distance_m", "way, m", 1),
    ("duration_s", "drive, s", 1),
    ("realtime_factor", "x real time", 1),
    ("peak_memory_mib", "memory, MiB", 0),
)


def write_batch_report(path: Path, manifest: str, values: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write one HTML page; `values` are those of `--json`.

    A row has besides `name`, `link`, `wall_s`, `values`, `machine`, `shift` and `figures` (those of `lhdmap.batch.figures`).
    """
    failed = [row for row in rows if row["status"] == "failed"]
    reasons = [(str(row["log"]), str(row["command"]), str(row["reason"])) for row in failed]
    parts = [
        markup.section("What happened", markup.cards(_cards(values))),
        markup.section("Failed", markup.table(("log", "command", "why"), reasons) if reasons else ""),
        trend_section(rows),
        markup.section("All logs", _table(rows)),
    ]
    path.write_text(markup.document(f"Batch {html.escape(manifest)}", "".join(parts)), encoding="utf-8")


def _cards(values: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    yield "logs", str(values["total"]), "rows of the manifest"
    yield "done", str(values["done"]), "in this run"
    yield "skipped", str(values["skipped"]), "complete already"
    yield "failed", str(values["failed"]), "the others went on"
    yield "retried", str(values["retried"]), "since their process was killed"


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the lines; the table of `markup` has no links."""
    head = ("log", "command", "status", "seconds", *(title for _, title, _ in _FIGURES), "pile")
    lines = ["".join(f"<th>{html.escape(one)}</th>" for one in head)]
    for row in rows:
        name = html.escape(str(row["log"]))
        link = f'<a href="{quote(str(row["link"]))}">{name}</a>' if row["link"] else name
        told = row["values"]
        cells = [link, html.escape(str(row["command"])), html.escape(str(row["status"])), f"{row['wall_s']:.1f}"]
        cells += [_figure(told.get(key), digits) for key, _, digits in _FIGURES]
        cells.append(html.escape(str(told.get("pile") or told.get("status") or "")))
        lines.append("".join(f"<td>{cell}</td>" for cell in cells))
    body = "".join(f"<tr>{line}</tr>\n" for line in lines)
    return f"<div class=table><table>\n{body}</table></div>\n"


def _figure(value: Any, digits: int) -> str:
    return f"{value:.{digits}f}" if isinstance(value, (int, float)) else ""
