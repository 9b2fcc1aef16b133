"""Entry point of `lhdmap`: finds the command, runs it, turns errors into one or two lines and an exit code.

A command is a module `lhdmap.cli.NAME` with `add_arguments(parser)` and `run(arguments, console) -> int`. Only the one that
is called is imported, so that `lhdmap --help` is quick.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from lhdmap import __version__
from lhdmap.errors import LhdmapError, LhdmapWarning

if TYPE_CHECKING:
    from lhdmap.cli.console import Console

COMMANDS = {
    "demo": "generate the sample drive, build its map, evaluate it, write report and recording",
    "doctor": "what is in a log and what is wrong with it",
    "build-map": "the main job: log in, map folder out",
    "pile": "find and measure the ore pile at the end of a drive",
    "rockbreaker": "plan trajectories of a rockbreaker over its grizzly",
    "simulate": "write a simulated log and its truth",
    "eval": "compare results with ground truth",
    "view": "open a map, log or run in Rerun",
    "config": "print the settings with unit and source",
}
EXIT_USAGE, EXIT_INPUT, EXIT_INTERRUPTED = 2, 3, 4
INSTALL_HINT = "on Debian, open3d needs: apt-get install libegl1 libgl1 libx11-6 libusb-1.0-0; all else comes with pip"
FAULT_HINT = "please report it with the output of the same command and --debug"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code: 0 done, 1 fell short, 2 usage, 3 input, 4 interrupted."""
    words = list(sys.argv[1:] if argv is None else argv)
    name = next((word for word in words if not word.startswith("-")), "")
    try:
        parser = _parser(name if name in COMMANDS else "")
        arguments = parser.parse_args(words)
    except SystemExit as stop:
        return int(stop.code or 0)
    if not getattr(arguments, "command", None):
        parser.print_help()
        return EXIT_USAGE
    return _run(arguments)


def entry_point() -> None:
    """Console script: `main` with the process's exit code."""
    for threads in (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
    ):  # libraries' thread pools wait for each other: one thread each
        os.environ.setdefault(threads, "1")
    gc.set_threshold(100_000, 20, 20)  # the libraries' hundreds of thousands of lasting objects are walked less often
    exit_code = main()
    if exit_code == EXIT_INTERRUPTED:
        # Where Ctrl-C met Python inside a compiled library, the interpreter would end by the signal and not with our code.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(exit_code)
    sys.exit(exit_code)


def _parser(chosen: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lhdmap", description="From a scanner log of a load-haul-dump machine to a map."
    )
    parser.add_argument("--version", action="version", version=f"lhdmap {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        sub = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if name == chosen:
            _module(name).add_arguments(sub)
            _add_common(sub)
    return parser


def _module(name: str):  # type: ignore[no-untyped-def]  # a module has no type of its own
    return importlib.import_module("lhdmap.cli." + name.replace("-", "_"))


def _add_common(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("common options")
    group.add_argument(
        "--json", action="store_true", help="one JSON object on standard output, all else on standard error"
    )
    group.add_argument("--quiet", action="store_true", help="no progress and no notes; warnings and errors stay")
    group.add_argument("--debug", action="store_true", help="show the traceback of an error")


def _run(arguments: argparse.Namespace) -> int:
    from lhdmap.cli.console import Console

    console = Console(json=arguments.json, quiet=arguments.quiet)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _shower(console, everything=arguments.debug)
            return int(_module(arguments.command).run(arguments, console))
    except KeyboardInterrupt:
        console.error("interrupted; what was finished is kept")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        return 0
    except Exception as error:  # noqa: BLE001  # the last resort: a fault of lhdmap is told in two lines as well
        if arguments.debug:
            traceback.print_exc()
        text, exit_code = _told(error)
        console.error(text)
        return exit_code


def _told(error: Exception) -> tuple[str, int]:
    """Return what a person is told of an error, and the exit code."""
    match error:
        case LhdmapError():
            return str(error), error.exit_code
        case OSError() | MemoryError():
            return f"{type(error).__name__}: {error}", EXIT_INPUT
        case ImportError():
            return f"the installation is not complete: {error}\n{INSTALL_HINT}", EXIT_INPUT
    return f"a fault in lhdmap, not in what you asked for: {type(error).__name__}: {error}\n{FAULT_HINT}", EXIT_INPUT


def _shower(console: Console, *, everything: bool) -> Callable[..., None]:
    """Return what shows warnings: those of lhdmap, which are about the input; of libraries only with `--debug`."""

    def show(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        if everything or issubclass(category, LhdmapWarning):
            console.warn(str(message))

    return show
