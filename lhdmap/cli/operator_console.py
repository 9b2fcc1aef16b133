"""`lhdmap console`: the operator's page for machines that connect to it; its operators and its audit."""

from __future__ import annotations

import argparse
import os
import socket
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_settings
from lhdmap.errors import InputError, UsageError

if TYPE_CHECKING:
    from lhdmap.console.serve import Listening


def default_folder() -> Path:
    """Return where a console keeps operators, key and audit."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "lhdmap" / "console"


def add_folder(parser: argparse.ArgumentParser) -> None:
    """Declare `--folder`."""
    text = (
        "operators, key of the machines and audit of a console (default: lhdmap/console in your configuration folder)"
    )
    parser.add_argument("--folder", type=Path, metavar="DIR", help=text)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap console`."""
    add_folder(parser)
    parser.add_argument("--host", default="127.0.0.1", help="where to listen; beyond this machine with TLS alone")
    parser.add_argument("--port", type=int, default=8460, help="default: 8460")
    parser.add_argument(
        "--viewer", default="", metavar="URL", help="a Rerun web viewer that is shown beside the machines"
    )
    parser.add_argument(
        "--origin",
        default="",
        metavar="URL",
        help="address of the page as browsers see it: behind a proxy, or by a name",
    )
    parser.add_argument("--certificate", type=Path, metavar="FILE", help="TLS certificate (PEM) ...")
    parser.add_argument("--certificate-key", type=Path, metavar="FILE", help="... and its key")
    add_settings(parser, ["console"])
    other = parser.add_mutually_exclusive_group()
    other.add_argument(
        "--new-operator", metavar="NAME", help="add an operator, print what his authenticator takes, and end"
    )
    other.add_argument("--check-audit", type=Path, metavar="FILE", help="is the audit whole; exit code 1 where not")
    text = "with --check-audit: journal.jsonl of a machine; the audit must have its hashes; repeatable"
    parser.add_argument("--kept", action="append", default=[], metavar="JOURNAL", type=Path, help=text)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Serve until Ctrl-C; or add an operator, or check an audit."""
    if arguments.check_audit is not None:
        return _check(arguments, console)
    if arguments.kept:
        raise UsageError("--kept: --check-audit was wanted beside it")
    from lhdmap.console.needs import check_installed

    check_installed("lhdmap console")
    folder = arguments.folder or default_folder()
    if arguments.new_operator is not None:
        return _add(folder, arguments.new_operator, console)
    return _serve(folder, arguments, console)


def _serve(folder: Path, arguments: argparse.Namespace, console: Console) -> int:
    from lhdmap.config import load_settings
    from lhdmap.console.serve import Listening, server_of

    listening = Listening(
        arguments.host,
        arguments.port,
        arguments.origin,
        arguments.viewer,
        arguments.certificate,
        arguments.certificate_key,
    )
    settings = load_settings(arguments.config, arguments.set).console
    server = server_of(folder, listening, settings)
    with _listener(listening) as listener:
        console.result({"console": listening.url, "folder": str(folder)}, f"console      {listening.url}", at_once=True)
        server.run(sockets=[listener])
    return 0


def _listener(listening: Listening) -> socket.socket:
    """Return the socket, bound: a place that is taken is told before anything starts."""
    try:
        family = socket.AF_INET6 if ":" in listening.host else socket.AF_INET
        return socket.create_server((listening.host, listening.port), family=family)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{listening.host}:{listening.port}: cannot listen there: {reason}") from error


def _add(folder: Path, name: str, console: Console) -> int:
    from lhdmap.console.operators import Operators

    address = Operators(folder).add(name)
    console.note("the address has the secret: give it to the authenticator, show it to nobody else")
    console.result({"operator": name, "uri": address}, address)
    return 0


def _check(arguments: argparse.Namespace, console: Console) -> int:
    from lhdmap.console.audit import check, kept_in

    kept = [one for journal in arguments.kept for one in kept_in(journal)]
    chain = check(arguments.check_audit, kept)
    beside = f", {len(kept)} hashes of journals are in it" if arguments.kept else ""
    values = {"audit": str(arguments.check_audit), "lines": chain.lines, "head": chain.head, "kept": len(kept)}
    console.result(values, f"whole        {chain.lines} lines{beside}\nhead         {chain.head}")
    return 0
