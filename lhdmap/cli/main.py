"""Entry point of `lhdmap`: finds the command, runs it, turns errors into one or two lines and an exit code.

A command is a module `lhdmap.cli.NAME` with `add_arguments(parser)` and `run(arguments, console) -> int`. Only the one that
is called is imported, so that `lhdmap --help` is quick.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import traceback
import warnings
from collections.abc import Sequence

from lhdmap import __version__
from lhdmap.errors import LhdmapError

COMMANDS = {
    "demo": "generate the sample drive, build its map, evaluate it, write report and recording",
    "doctor": "what is in a log and what is wrong with it",
    "build-map": "the main job: log in, map folder out",
    "simulate": "write a simulated log and its truth",
    "eval": "compare results with ground truth",
    "view": "open a map, log or run in Rerun",
    "config": "print the settings with unit and source",
}
EXIT_USAGE, EXIT_INPUT, EXIT_INTERRUPTED = 2, 3, 4


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
    sys.exit(main())


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
            warnings.showwarning = lambda message, *_, **__: console.warn(str(message))
            return int(_module(arguments.command).run(arguments, console))
    except LhdmapError as error:
        if arguments.debug:
            traceback.print_exc()
        console.error(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        console.error("interrupted; what was finished is kept")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        return 0
    except (OSError, MemoryError) as error:
        if arguments.debug:
            traceback.print_exc()
        console.error(f"{type(error).__name__}: {error}")
        return EXIT_INPUT
