"""`lhdmap production RUN…`: what replays produced, and what their time went into."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap production`."""
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="folders of replays, or their journal.jsonl")
    parser.add_argument(
        "--shift-h",
        type=float,
        metavar="H",
        help="hours that were scheduled, from the first record on (default: all of it)",
    )
    add_output(parser, "folder for a page, tables (CSV, parquet) and IREDES files (default: none is written)")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Print the figures; write the folder where one is named."""
    from lhdmap.outputs import free_folder
    from lhdmap.pipeline.production_run import production_of_runs, write_run

    if arguments.output:
        free_folder(arguments.output, force=arguments.force, inputs=arguments.runs)
    production = production_of_runs(arguments.runs, arguments.shift_h)
    values = production.values()
    if arguments.output:
        folder = write_run(arguments.output, production, arguments.runs, force=arguments.force)
        console.note(f"report: {folder / 'report.html'}")
    console.result(values, _text(values))
    return 0


def _text(values: dict[str, Any]) -> str:
    """Return the figures in words."""
    lines = [f"{values['cycles']} buckets, {values['tonnes']:.1f} t, {_number(values['tonnes_per_hour'], 't/h')}"]
    lines += [f"cycle {_number(values['cycle_mean_s'], 's')}, fill {_number(values['fill_mean'], '')}".rstrip()]
    lines += [f"{phase:<24} {seconds:10.1f} s" for phase, seconds in values["time_by_phase_s"].items()]
    lines += [f"{level:<24} {seconds:10.1f} s" for level, seconds in values["levels_s"].items()]
    stops = [
        f"{one['times']} × {one['phase']} at {one['place'] or '?'}: {one['seconds']:.1f} s" for one in values["stops"]
    ]
    each = [
        f"{one['machine']}: {one['cycles']} buckets, {one['tonnes']:.1f} t, waited {one['waits_s']:.1f} s for others"
        for one in values["machines"]
    ]
    return "\n".join([*lines, *(each if len(each) > 1 else []), *stops])


def _number(value: float | None, unit: str) -> str:
    return "not known" if value is None else f"{value:.2f} {unit}".rstrip()
