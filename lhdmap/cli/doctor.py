"""`lhdmap doctor LOG...`: what is in a log and what is wrong with it, with a verdict for each."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_topics, topic_overrides
from lhdmap.errors import InputError
from lhdmap.logs.base import LogReader
from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.logs.doctor.health import Examination, LogVerdict, examine
from lhdmap.logs.inventory import Inventory, TopicSummary
from lhdmap.messages import Record
from lhdmap.names import name_of

_WIDTH = 118
_ORDER = (Severity.FATAL, Severity.PROBLEM, Severity.REMARK, Severity.NOTE)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = "Exit code: 0 all logs are usable (remarks included), 3 one is not."
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="log file or ROS 2 bag folder")
    add_topics(parser)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Examine each log, print the outcome, return the exit code."""
    overrides = topic_overrides(arguments.topic)

    def progress(reader: LogReader, records: Iterator[Record]) -> Iterator[Record]:
        start_ns = reader.start_ns or 0

        def position(record: Record) -> float:
            return (record.log_time_ns - start_ns) / 1e9

        return console.progress(records, total=reader.duration_s or 1.0, label=name_of(reader.path), position=position)

    outcomes = [examine(path, overrides, progress) for path in arguments.logs]
    text = "\n\n".join("\n".join(_lines(outcome)) for outcome in outcomes)
    failure = _failure(outcomes)
    console.result({"logs": [_plain(outcome) for outcome in outcomes]}, text, failure=failure)
    return 0 if failure is None else failure.exit_code


def _failure(outcomes: list[Examination]) -> InputError | None:
    """Return why the exit code is 3, None where all logs are usable."""
    for outcome in outcomes:
        if outcome.verdict is LogVerdict.UNUSABLE:
            fatal = [finding.text for finding in outcome.findings if finding.severity is Severity.FATAL]
            text = "; ".join(fatal) or str(outcome.verdict)
            return InputError(text if text.startswith(str(outcome.path)) else f"{outcome.path}: {text}")
    return None


def _lines(outcome: Examination) -> list[str]:
    lines = [f"{outcome.path}: {outcome.verdict}"]
    if outcome.inventory is not None:
        lines += _inventory_lines(outcome.inventory)
    for finding in sorted(outcome.findings, key=lambda finding: _ORDER.index(finding.severity)):
        lines += _finding_lines(finding)
    return lines


def _inventory_lines(inventory: Inventory) -> list[str]:
    duration = "unknown" if inventory.duration_s is None else f"{inventory.duration_s:.1f} s"
    lines = [f"  {inventory.format}, {inventory.size_bytes / 1e6:.1f} MB, duration {duration}"]
    rows = [_row(topic) for topic in inventory.topics.values()]
    table = [("topic", "type", "messages", "rate", "longest gap", "used as"), *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(table[0]))]
    for row in table:
        cells = [
            cell.rjust(width) if column in (2, 3, 4) else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  " + "  ".join(cells).rstrip())
    return lines


def _row(topic: TopicSummary) -> tuple[str, ...]:
    count = "?" if topic.count is None else str(topic.count)
    rate = "" if topic.rate_hz is None or (topic.count or 0) < 2 else f"{topic.rate_hz:.2f} Hz"
    gap = "" if topic.max_gap_s is None else f"{topic.max_gap_s:.3f} s"
    return topic.name, topic.type_name, count, rate, gap, topic.role or ""


def _finding_lines(finding: LogFinding) -> list[str]:
    where = f"{finding.topic}: " if finding.topic else ""
    advice = f"; {finding.advice}" if finding.advice else ""
    label = f"  {finding.severity:<8}"
    return textwrap.wrap(
        where + finding.text + advice, _WIDTH, initial_indent=label, subsequent_indent=" " * len(label),
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _plain(outcome: Examination) -> dict[str, Any]:
    inventory = outcome.inventory
    return {
        "path": str(outcome.path),
        "format": None if inventory is None else inventory.format,
        "verdict": str(outcome.verdict),
        "duration_s": None if inventory is None else inventory.duration_s,
        "size_bytes": None if inventory is None else inventory.size_bytes,
        "topics": {} if inventory is None else {name: _topic(topic) for name, topic in inventory.topics.items()},
        "findings": [finding._asdict() for finding in outcome.findings],
    }


def _topic(topic: TopicSummary) -> dict[str, Any]:
    return {
        "type": topic.type_name,
        "role": topic.role,
        "count": topic.count,
        "rate_hz": topic.rate_hz,
        "max_gap_s": topic.max_gap_s,
    }
