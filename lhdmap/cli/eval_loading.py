"""`lhdmap eval loading LOG…`: Tables 3, 4 and 5 of the loading paper from logs, beside the paper's."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_settings, add_topics, topic_overrides
from lhdmap.errors import EvaluationShortfall, InputError, LhdmapError
from lhdmap.interrupts import before_interrupt

if TYPE_CHECKING:
    from lhdmap.evaluation.loading.loads import Load

_LIMITS = (
    ("max_attempts", "mean number of attempts of a load"),
    ("min_fill", "mean fill of a load"),
    ("min_first_fill", "mean fill after the first attempt"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the subject `loading`."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="logs of loadings, or folders of replays")
    add_output(parser, "folder for tables (CSV) and all of it as JSON (default: none is written)")
    add_topics(parser)
    add_settings(parser, ["weighing"])
    limits = parser.add_argument_group("limits: exit code 1 where the loads are worse")
    for flag, text in _LIMITS:
        limits.add_argument(f"--{flag.replace('_', '-')}", type=float, metavar="X", help=text)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Evaluate, print, and raise where a log could not be used (exit code 3) or a limit is missed (1)."""
    from lhdmap.evaluation.loading.result import result_of, write_run
    from lhdmap.evaluation.loading.text import as_text
    from lhdmap.outputs import free_folder

    if arguments.output:
        free_folder(arguments.output, force=arguments.force, inputs=arguments.logs)
    loads: list[Load] = []
    problems: list[str] = []

    def shown() -> None:
        if loads or problems:
            text = as_text(loads) if loads else ""
            console.result(
                result_of(loads, problems), "\n".join([text, *(f"not used: {one}" for one in problems)]).strip()
            )

    with before_interrupt(shown):
        try:
            _read(arguments, loads, problems, console)
        except KeyboardInterrupt:
            shown()
            raise
    shown()
    if arguments.output and loads:
        path = write_run(arguments.output, loads, arguments.logs, problems, force=arguments.force)
        console.note(f"tables: {path}")
    _check(arguments, loads, problems)
    return 0


def _read(arguments: argparse.Namespace, loads: list[Load], problems: list[str], console: Console) -> None:
    """Add the loads of all logs, or why one has none."""
    from lhdmap.config import load_settings
    from lhdmap.evaluation.loading.read import LoadingRequest, read_loads

    weighing = load_settings(arguments.config, arguments.set).weighing
    topics = topic_overrides(arguments.topic)
    for log in arguments.logs:
        try:
            found = read_loads(LoadingRequest(log, topics, weighing))
        except LhdmapError as error:
            problems.append(str(error))
            continue
        loads += found.loads
        for text in found.warnings:
            console.warn(text if text.startswith(str(log)) else f"{log}: {text}")


def _check(arguments: argparse.Namespace, loads: list[Load], problems: list[str]) -> None:
    from lhdmap.evaluation.loading.tables import tables_of

    if problems:
        raise InputError(f"{len(problems)} of {len(arguments.logs)} logs could not be used, the first: {problems[0]}")
    tables = tables_of(loads)
    first = tables.table5[0].fill.mean if tables.table5 else float("nan")
    values = {"max_attempts": tables.attempts.mean, "min_fill": tables.fill.mean, "min_first_fill": first}
    missed = []
    for flag, text in _LIMITS:
        limit, value = getattr(arguments, flag), values[flag]
        if limit is not None and not (value <= limit if flag.startswith("max") else value >= limit):
            missed.append(f"{text} {value:.3g}, {flag[:3]}imum {limit:g}")
    if missed:
        raise EvaluationShortfall("evaluation fell short: " + "; ".join(missed))
