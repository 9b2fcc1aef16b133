"""`lhdmap eval navigation LOG…`: Tables 3 and 4 of the navigation paper from logs, beside the paper's."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_topics, suggest, topic_overrides
from lhdmap.errors import EvaluationShortfall, InputError, LhdmapError, UsageError
from lhdmap.interrupts import before_interrupt

if TYPE_CHECKING:
    from lhdmap.evaluation.navigation.row import Row
    from lhdmap.pipeline.navigation import Drive, DriveRequest

_LOADS = {"E": "E", "L": "L", "EMPTY": "E", "LOADED": "L", "-": None}
_LIMITS = (
    ("max_acd", "acd", "average command difference"),
    ("max_asd", "asd", "average state difference"),
    ("min_mean_speed_kmh", "mean_speed_kmh", "mean speed while navigating, km/h"),
    ("min_wall_m", "least_wall_m", "least distance to a wall, m"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the subject `navigation`."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="logs of drives, or folders of replays")
    parser.add_argument(
        "--load",
        default="",
        metavar="E|L,…",
        help="bucket empty or loaded: one for all logs, or one for each; - is not told (default: what a replay says)",
    )
    suggest(
        parser.add_argument(
            "--operation",
            default="",
            metavar="MODE",
            help="who drove, for logs without /operation/mode: autonomous, manual or teleoperated",
        ),
        "autonomous",
        "manual",
        "teleoperated",
    )
    add_output(parser, "folder for tables (CSV), samples and a report with plots (default: none is written)")
    add_topics(parser)
    parser.add_argument("--machine", type=Path, metavar="FILE.toml", help="machine description")
    limits = parser.add_argument_group("limits: exit code 1 where a drive is worse")
    for flag, _, text in _LIMITS:
        limits.add_argument(f"--{flag.replace('_', '-')}", type=float, metavar="X", help=text)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Evaluate, print, and raise where a log could not be used (exit code 3) or a limit is missed (1)."""
    from lhdmap.outputs import free_folder
    from lhdmap.pipeline.navigation_run import result_of, write_run

    requests = _requests(arguments, console)
    if arguments.output:
        free_folder(arguments.output, force=arguments.force, inputs=arguments.logs)
    drives: list[Drive] = []
    rows: list[Row] = []

    def shown() -> None:
        if rows:
            console.result(result_of(rows), _text(rows))

    with before_interrupt(shown):
        try:
            for request in requests:
                _read(request, drives, rows, console)
        except KeyboardInterrupt:
            shown()
            raise
    shown()
    if arguments.output and drives:
        path = write_run(arguments.output, drives, rows, force=arguments.force)
        console.note(f"report: {path / 'report.html'}")
    _check(arguments, rows)
    return 0


def _requests(arguments: argparse.Namespace, console: Console) -> list[DriveRequest]:
    from lhdmap.cli.build_map import progress_of
    from lhdmap.machine import load_machine
    from lhdmap.pipeline.navigation import DriveRequest

    if arguments.operation not in ("", "autonomous", "manual", "teleoperated"):
        raise UsageError(f"--operation {arguments.operation}: autonomous, manual or teleoperated was wanted")
    machine = load_machine(arguments.machine) if arguments.machine else None
    topics, progress = topic_overrides(arguments.topic), progress_of(console, "eval navigation")
    loads = _loads(arguments.load, len(arguments.logs))
    return [
        DriveRequest(log, load, arguments.operation, topics, machine, progress)
        for log, load in zip(arguments.logs, loads, strict=True)
    ]


def _loads(text: str, count: int) -> list[str | None]:
    """Return the load told of each log."""
    words = text.upper().split(",") if text else ["-"]
    if any(word not in _LOADS for word in words):
        raise UsageError(f"--load {text}: E (empty), L (loaded) or - was wanted, for all logs or for each, e.g. E,L,E")
    if len(words) not in (1, count):
        raise UsageError(f"--load {text}: {len(words)} were told for {count} logs; one for all, or one for each")
    return [_LOADS[word] for word in (words * count if len(words) == 1 else words)]


def _read(request: DriveRequest, drives: list[Drive], rows: list[Row], console: Console) -> None:
    """Add the drive of one log, or the row that says why there is none."""
    from lhdmap.evaluation.navigation.row import failed
    from lhdmap.pipeline.navigation import read_drive

    try:
        drive = read_drive(request)
    except LhdmapError as error:
        rows.append(failed(str(request.log), request.load, str(error)))
        return
    drives.append(drive)
    rows.append(drive.row)
    for text in drive.row.warnings:
        console.warn(text if text.startswith(str(request.log)) else f"{request.log}: {text}")


def _text(rows: list[Row]) -> str:
    from lhdmap.evaluation.navigation.tables import as_text

    return as_text(rows)


def _check(arguments: argparse.Namespace, rows: list[Row]) -> None:
    broken = [row for row in rows if row.problem]
    if broken:
        raise InputError(f"{len(broken)} of {len(rows)} logs could not be used, the first: {broken[0].problem}")
    missed = []
    for flag, name, text in _LIMITS:
        limit = getattr(arguments, flag)
        for row in rows if limit is not None else ():
            value = _figure(row, name)
            if value is None or (value > limit if flag.startswith("max") else value < limit):
                missed.append(f"{row.log}: {text} {_told(value)}, {flag[:3]}imum {limit:g}")
    if missed:
        raise EvaluationShortfall("evaluation fell short: " + "; ".join(missed))


def _figure(row: Row, name: str) -> Any:
    if name != "least_wall_m":
        return row.figures[name]
    least = [row.figures[side] for side in ("mdlw_m", "mdrw_m")]
    return min((value for value in least if value is not None), default=None)


def _told(value: float | None) -> str:
    return "not known" if value is None else f"{value:.4g}"
