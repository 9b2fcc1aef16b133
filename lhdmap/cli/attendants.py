"""`--operator` of a replay: the script, a terminal, a console, or what an earlier run's journal says was done."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.operator_console import add_folder, default_folder
from lhdmap.errors import UsageError

if TYPE_CHECKING:
    from lhdmap.config import Settings
    from lhdmap.console.attendant import Attendant

_SCRIPT, _TERMINAL, _CONSOLE = "script", "terminal", "console"
_URL = "http://127.0.0.1:8460"


def add_operator(parser: argparse.ArgumentParser) -> None:
    """Declare `--operator` and what belongs to it."""
    parser.add_argument(
        "--operator",
        default=_SCRIPT,
        metavar="WHO",
        help="who helps and arms: script (default), terminal, console or console:URL, or the journal.jsonl of an earlier run",
    )
    parser.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="with a console: so much faster than real time (default: 1)",
    )
    add_folder(parser)


@contextlib.contextmanager
def attendant_of(
    arguments: argparse.Namespace, name: str, settings: Settings, console: Console
) -> Iterator[Attendant | None]:
    """Have whoever is to attend the machine `name`; None: the script.

    Raises:
        UsageError: there is no such operator.
        InputError: no console answers, or the journal is none.
    """
    kind, _, url = arguments.operator.partition(":")
    if arguments.operator == _SCRIPT:
        yield None
    elif arguments.operator == _TERMINAL:
        from lhdmap.cli.operator import TerminalAttendant

        if console.quiet:
            raise UsageError("--quiet and --operator terminal: a terminal asks; one of them was wanted")
        yield TerminalAttendant(console.ask, console.note)
    elif kind == _CONSOLE:
        with _linked(arguments, name, url or _URL, settings, console) as link:
            yield link
    elif Path(arguments.operator).is_file():
        from lhdmap.console.attendant import Recorded

        yield Recorded.of(Path(arguments.operator))
    else:
        wanted = "script, terminal, console, console:URL or a journal.jsonl was wanted"
        raise UsageError(f"--operator {arguments.operator}: {wanted}")


@contextlib.contextmanager
def _linked(
    arguments: argparse.Namespace, name: str, url: str, settings: Settings, console: Console
) -> Iterator[Attendant]:
    from lhdmap.console.link import MachineLink
    from lhdmap.console.needs import check_installed
    from lhdmap.console.operators import machine_key

    check_installed("--operator console")
    if not 0.01 <= arguments.speed <= 100.0:
        raise UsageError(f"--speed {arguments.speed:g}: 0.01 to 100 was wanted")
    if not url.startswith(("http://", "https://")):
        raise UsageError(f"--operator console:{url}: console:http://HOST:PORT was wanted")
    key = machine_key(arguments.folder or default_folder())
    link = MachineLink(name, url, key, settings.console, arguments.speed)
    try:
        link.connect()
        console.note(f"{name} is at {url}; it begins when an operator takes the seat there")
        console.note(f"{link.wait_for_operator()} operates")
        yield link
    finally:
        link.close()
