"""`main`: finds the command, runs it, turns errors into one or two lines and an exit code.

A command is a module `lhdmap.cli.NAME` with `add_arguments(parser)` and `run(arguments, console) -> int`. Only the one that
is called is imported, so that `lhdmap --help` is quick.
"""

from __future__ import annotations

import argparse
import errno
import importlib
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence

from lhdmap import __version__
from lhdmap.cli.console import STANDARD_OUTPUT, Console
from lhdmap.cli.interrupt import EXIT_INTERRUPTED, told
from lhdmap.cli.options import add_common
from lhdmap.cli.parser import CommandLineError, Parser
from lhdmap.errors import InstallationError, LhdmapError, LhdmapWarning, kept_with
from lhdmap.extras import missing_text

COMMANDS = {
    "demo": "generate the sample drive, build its map, evaluate it, write report and recording",
    "doctor": "what is in a log and what is wrong with it",
    "build-map": "the main job: log in, map folder out",
    "live": "follow a running machine: map or place while it drives, and the log",
    "localize": "where was the machine on the map, message by message",
    "update-map": "a new version of a map from another drive, with a difference report",
    "info": "what is in a map or run folder, in ten lines",
    "view": "open a map, log or run in Rerun",
    "pile": "find and measure the ore pile at the end of a drive",
    "loading": "calibrate the weighing model of a loader",
    "rockbreaker": "plan trajectories of a rockbreaker over its grizzly",
    "simulate": "write a simulated log and its truth",
    "replay": "drive a simulated machine in closed loop: log, journal, verdict, report",
    "route": "movement sequence between two places of a map, with inversions and its cost",
    "check-map": "is the map ready to run on, and if not, why",
    "production": "what replays produced, and what their time went into",
    "export": "a map in a format that other tools read",
    "console": "the operator's page: requests for help, answers, arming, alarms",
    "batch": "many logs, on all cores or on a cluster: one table, one page",
    "eval": "compare results with ground truth",
    "config": "print the settings with unit and source",
    "completion": "print the tab completion for bash, zsh or fish",
}
_MODULES = {"console": "operator_console"}  # `console` is what a command prints with
EXIT_USAGE, EXIT_INPUT = 2, 3
_COMMON = ("--json", "--quiet", "--debug")
FAULT_HINT = "please report it with the output of the same command and --debug"
_HINTS = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "; make room, or name another place with -o"),
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM, errno.EROFS), "; name another place with -o, or get the right to write"
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code: 0 done, 1 fell short, 2 usage, 3 input, 4 interrupted."""
    words = _command_first(list(sys.argv[1:] if argv is None else argv))
    console = Console(json="--json" in words, quiet="--quiet" in words)
    try:
        parser = command_parser(words[:1])
        arguments = parser.parse_args(words)
        if getattr(arguments, "command", None):
            return _run(arguments, console)
        if console.json:
            parser.error("a command was wanted")
        parser.print_help()
    except SystemExit as stop:  # after --help and --version
        return int(stop.code or 0)
    except KeyboardInterrupt as error:
        console.fail("interrupted", told(kept_with(error)), EXIT_INTERRUPTED)
        return EXIT_INTERRUPTED
    except CommandLineError as error:
        console.usage(error.usage)
        console.fail(error.kind, str(error), error.exit_code)
    return EXIT_USAGE


def entry_point() -> None:
    """Run the program: for console scripts that were made before `lhdmap.cli.start`."""
    from lhdmap.cli.start import entry_point as start

    start()


def command_parser(chosen: Sequence[str]) -> Parser:
    """Return the parser, with the options of the `chosen` commands alone: their modules are imported."""
    parser = Parser(prog="lhdmap", description="From a scanner log of a load-haul-dump machine to a map.")
    parser.add_argument("--version", action="version", version=f"lhdmap {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        sub = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if name in chosen:
            _module(name).add_arguments(sub)
            add_common(sub)
    return parser


def _command_first(words: list[str]) -> list[str]:
    """Return the words with common options that stand before the command behind it: `lhdmap --json doctor LOG`."""
    count = next((k for k, word in enumerate(words) if word not in _COMMON), len(words))
    return [*words[count : count + 1], *words[:count], *words[count + 1 :]]


def _module(name: str):  # type: ignore[no-untyped-def]  # a module has no type of its own
    return importlib.import_module("lhdmap.cli." + _MODULES.get(name, name.replace("-", "_")))


def _run(arguments: argparse.Namespace, console: Console) -> int:
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _shower(console, everything=arguments.debug)
            exit_code = int(_module(arguments.command).run(arguments, console))
            console.close()
            return exit_code
    except (KeyboardInterrupt, CommandLineError):
        raise
    except BrokenPipeError:
        return 0
    except Exception as error:  # noqa: BLE001  # the last resort: a fault of lhdmap is told in two lines as well
        if arguments.debug:
            traceback.print_exc()
        kind, text, exit_code = _told(error)
        kept = "".join(f"; what was finished is kept in {path}" for path in kept_with(error)[-1:])
        console.fail(kind, text + kept, exit_code)
        return exit_code


def _told(error: Exception) -> tuple[str, str, int]:
    """Return the kind of an error, what a person is told of it, and the exit code."""
    match error:
        case LhdmapError():
            return error.kind, str(error), error.exit_code
        case OSError():
            return "system", _system_text(error), EXIT_INPUT
        case MemoryError():
            return "system", f"not enough memory: {error}".rstrip(": "), EXIT_INPUT
        case ImportError():
            return InstallationError.kind, missing_text(error), EXIT_INPUT
    text = f"a fault in lhdmap, not in what you asked for: {type(error).__name__}: {error}\n{FAULT_HINT}"
    return "fault", text, EXIT_INPUT


def _system_text(error: OSError) -> str:
    """Return in one line what the operating system refused, and where."""
    number = error.errno if error.errno is not None else errno.ENOSPC if "No space left" in str(error) else 0
    where = "" if error.filename is None else f"{error.filename}: "
    reason = error.strerror or " ".join(str(error).split()) or type(error).__name__
    hint = "" if error.filename == STANDARD_OUTPUT else _HINTS.get(number, "")
    return f"{where}{reason}{hint}"


def _shower(console: Console, *, everything: bool) -> Callable[..., None]:
    """Return what shows warnings: those of lhdmap, which are about the input; of libraries only with `--debug`."""

    def show(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        if everything or issubclass(category, LhdmapWarning):
            console.warn(str(message))

    return show
