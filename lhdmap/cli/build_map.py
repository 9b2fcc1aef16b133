"""`lhdmap build-map LOG…`: log in, map folder out."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.errors import UsageError
from lhdmap.names import beside


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap build-map`."""
    parser.add_argument(
        "logs", nargs="+", type=Path, metavar="LOG", help="log file or bag folder; several are one drive"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="map folder to make (default: beside the log)")
    parser.add_argument(
        "--config", type=Path, metavar="FILE.toml", help="settings over the defaults (lhdmap config prints them)"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="section.key=value", help="one setting; repeatable"
    )
    parser.add_argument(
        "--topic", action="append", default=[], metavar="role=/topic", help="topic of a role, e.g. front=/scan"
    )
    parser.add_argument(
        "--poses",
        default="",
        metavar="FILE.tum",
        help="integrate with given poses: a TUM file, or ground-truth for those in the log",
    )
    parser.add_argument(
        "--machine", type=Path, metavar="FILE.toml", help="machine description (dimensions, bodies, mounts)"
    )
    parser.add_argument(
        "--one-process",
        action="store_true",
        help="no second process for pile, recording and report: less memory, slower",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Build the map and print where it is."""
    from lhdmap.config import load_settings
    from lhdmap.machine import load_machine
    from lhdmap.pipeline.build import BuildRequest, build_map

    request = BuildRequest(
        logs=arguments.logs,
        target=arguments.output or beside(arguments.logs[0], "map"),
        settings=load_settings(arguments.config, arguments.set),
        topics=topic_overrides(arguments.topic),
        machine=load_machine(arguments.machine) if arguments.machine else None,
        progress=progress_of(console),
        poses=arguments.poses,
        helper=not arguments.one_process,
    )
    result = build_map(request)
    for text in result.warnings:
        console.warn(text)
    console.result(result.summary | {"warnings": result.warnings}, summary_text(result.summary))
    return 0


def topic_overrides(words: Iterable[str]) -> dict[str, str]:
    """Return topics by role from `role=/topic` words.

    Raises:
        UsageError: a word has no `=`.
    """
    found = {}
    for word in words:
        role, equals, topic = word.partition("=")
        if not (role and equals and topic):
            raise UsageError(f"--topic {word}: role=/topic was wanted, e.g. front=/scan")
        found[role] = topic
    return found


def progress_of(console: Console) -> Any:
    """Return a wrapper that shows progress by the stamps of the messages."""

    def wrap(messages: Iterable[Any], duration_s: float) -> Iterable[Any]:
        """Return the messages (role, message), shown as they go by."""
        start: list[int] = []

        def position(item: Any) -> float:
            if not start:
                start.append(item[1].stamp_ns)
            return float(item[1].stamp_ns - start[0]) * 1e-9

        return console.progress(messages, total=duration_s, label="build-map", position=position)

    return wrap


def summary_text(summary: dict[str, Any]) -> str:
    """Return the result in words."""
    from lhdmap.report.text import cost_line, duration

    reason = str(summary["pile_reason"]).replace("no pile was looked for", "not looked for")
    pile = summary["pile"].replace("_", " ") if summary["pile"] else reason
    return "\n".join(
        [
            f"map          {summary['map']}",
            f"report       {Path(summary['map']) / 'report.html'}",
            f"drive        {summary['distance_m']:.1f} m in {duration(summary['duration_s'])}",
            *_ways(summary),
            f"pile         {pile}",
            f"run          {cost_line(summary)}",
        ]
    )


def _ways(summary: dict[str, Any]) -> list[str]:
    """Return how the path was found: from the scans, or given."""
    if summary["poses"]:
        return [f"scans        {summary['scans']}", f"poses        given: {summary['poses']}"]
    return [
        f"scans        {summary['scans']} ({summary['scans_processed']} processed)",
        f"weak scans   {100 * summary['degenerate_share']:.0f} %, lost stretches {summary['lost_stretches']}",
    ]
