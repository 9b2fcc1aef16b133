"""`lhdmap batch MANIFEST.csv`: many logs, on all cores or on a cluster."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_force
from lhdmap.errors import EvaluationShortfall, UsageError
from lhdmap.names import beside

if TYPE_CHECKING:
    from lhdmap.batch.work import JobOutcome, Runner

_ONE = threading.Lock()  # standard output is the process's: a worker with several threads takes one row at a time
_SAID = 50_000  # characters of what a command said that are kept


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap batch`."""
    parser.add_argument(
        "manifest",
        type=Path,
        metavar="MANIFEST.csv",
        help="a line a log: log, optionally map, machine, config, command (build-map, localize, pile, doctor, replay), "
        "name, shift",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="folder (default: MANIFEST_batch beside it); gone on with if there",
    )
    add_force(parser)
    parser.add_argument(
        "--store", default="", metavar="URL", help="results go here, on an object store: s3://bucket/night"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=int, metavar="N", help="processes at the same time (default: one a core)")
    where.add_argument("--cluster", metavar="ADDRESS", help="scheduler of dask.distributed, e.g. tcp://10.0.0.1:8786")
    parser.add_argument(
        "--row-time-s", type=float, metavar="S", help="a row that takes longer is ended (default: none)"
    )
    parser.add_argument(
        "--memory-limit-gib", type=float, metavar="GIB", help="a row whose process takes more is ended (default: none)"
    )
    parser.epilog = "What is complete is skipped; --force runs all rows anew. Exit code 1 where a row failed."


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Run the rows; exit code 1 where one failed."""
    from lhdmap.batch.run import BatchRequest, run_batch

    runner = _runner(arguments, console)
    target = arguments.output or beside(arguments.manifest, "batch")
    request = BatchRequest(
        arguments.manifest, target.absolute(), run_words, runner, arguments.force, console.note, arguments.store
    )
    result = run_batch(request)
    values = result.to_json()
    failed = [row for row in result.rows if row.status == "failed"]
    failure = None
    if failed:
        first = f"{failed[0].task.log}: {failed[0].reason}"
        failure = EvaluationShortfall(f"{len(failed)} of {len(result.rows)} rows failed; the first: {first}")
    console.result(values, _text(values), failure=failure)
    return 0 if failure is None else failure.exit_code


def run_words(words: Sequence[str]) -> JobOutcome:
    """Run one command line in this process and return what came of it: what workers do."""
    from lhdmap.batch.figures import folder_figures
    from lhdmap.batch.work import JobOutcome
    from lhdmap.cli.main import main

    printed, said = io.StringIO(), io.StringIO()
    with _ONE, contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
        exit_code = main(list(words))
    try:
        values = json.loads(printed.getvalue() or "{}")
    except ValueError:
        values = {}
    figures = folder_figures(Path(words[words.index("-o") + 1])) if "-o" in words else {}
    return JobOutcome(exit_code, values if isinstance(values, dict) else {}, said.getvalue()[-_SAID:], figures)


def warm_node() -> None:
    """Compile and load the kernels of mapping on a node."""
    from lhdmap.config import Settings
    from lhdmap.live.warm_up import warm_up

    warm_up(Settings(), None)


def _runner(arguments: argparse.Namespace, console: Console) -> Runner:
    from lhdmap.batch.limits import Limits
    from lhdmap.batch.work import Warm

    limits, warm = Limits(arguments.row_time_s, arguments.memory_limit_gib), Warm(warm_node, console.note)
    if arguments.cluster:
        from lhdmap.batch.cluster import check_installed, run_on_cluster

        check_installed()
        if limits.any:
            raise UsageError(
                "--row-time-s and --memory-limit-gib are of this machine; dask worker has its own --memory-limit"
            )
        return partial(run_on_cluster, address=arguments.cluster, told=console.note, warm=warm)
    from lhdmap.batch.pool import run_here

    if arguments.jobs is not None and arguments.jobs < 1:
        raise UsageError(f"--jobs {arguments.jobs}: 1 or more was wanted")
    return partial(run_here, workers=arguments.jobs or _cores(), limits=limits, warm=warm)


def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _text(values: dict[str, Any]) -> str:
    """Return the result in words."""
    lines = [
        f"batch        {values['batch']}",
        f"report       {values['report']}",
        f"rows         {values['total']}: {values['done']} done, {values['skipped']} complete already, {values['failed']} failed",
    ]
    lines += [f"retried      {values['retried']}"] if values["retried"] else []
    lines += [f"failed       {row['log']}: {row['reason']}" for row in values["rows"] if row["status"] == "failed"]
    return "\n".join(lines)
