"""`lhdmap build-map LOG…`: log in, map folder out."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_poses, add_settings, add_topics, topic_overrides
from lhdmap.names import beside


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap build-map`."""
    parser.add_argument(
        "logs",
        nargs="+",
        type=Path,
        metavar="LOG",
        help="log or bag folder; several: parts of one drive, or drives that overlap",
    )
    add_output(parser, "map folder to make (default: LOG_map beside the log)")
    add_settings(parser)
    add_topics(parser)
    add_poses(parser)
    parser.add_argument(
        "--machine", type=Path, metavar="FILE.toml", help="machine description (dimensions, bodies, mounts)"
    )
    parser.add_argument(
        "--edits",
        type=Path,
        metavar="FILE.toml",
        help="changes of the topology: names, limits, closures (docs/topology.md)",
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
    from lhdmap.pipeline.build import BuildRequest
    from lhdmap.pipeline.join import build_drives

    request = BuildRequest(
        logs=arguments.logs,
        target=arguments.output or beside(arguments.logs[0], "map"),
        settings=load_settings(arguments.config, arguments.set),
        topics=topic_overrides(arguments.topic),
        machine=load_machine(arguments.machine) if arguments.machine else None,
        progress=progress_of(console),
        poses=arguments.poses,
        helper=not arguments.one_process,
        force=arguments.force,
        edits=arguments.edits,
    )
    result = build_drives(request)
    for text in result.warnings:
        console.warn(text)
    console.result(result.summary | {"warnings": result.warnings}, summary_text(result.summary))
    return 0


def progress_of(console: Console, label: str = "build-map") -> Any:
    """Return a wrapper that shows progress by the stamps of the messages."""

    def wrap(messages: Iterable[Any], duration_s: float) -> Iterable[Any]:
        """Return the messages (role, message), shown as they go by."""
        start: list[int] = []

        def position(item: Any) -> float:
            if not start:
                start.append(item[1].stamp_ns)
            return float(item[1].stamp_ns - start[0]) * 1e-9

        return console.progress(messages, total=duration_s, label=label, position=position)

    return wrap


def summary_text(summary: dict[str, Any]) -> str:
    """Return the result in words."""
    from lhdmap.report.text import cost_line, duration, trust_line

    reason = str(summary["pile_reason"]).replace("no pile was looked for", "not looked for")
    pile = summary["pile"].replace("_", " ") if summary["pile"] else reason
    trust = trust_line(summary)
    return "\n".join(
        [
            *([] if trust is None else [f"may be off   {trust}"]),
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
