"""The Rerun viewer that comes with the package: where its program is, how it is run, and what it can open."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError
from lhdmap.interrupts import before_interrupt

MAGIC, OLD_MAGIC, FOOT = b"RRF2", (b"RRF0", b"RRF1"), b"RRF2FOOT"
_TAIL_BYTES = 64
_CHECK_LIMIT_S = 20.0


def viewer(*options: str) -> list[str]:
    """Return the command line of the viewer that comes with the package rerun-sdk: its program, else its module."""
    spec = importlib.util.find_spec("rerun_cli")
    for folder in (spec.submodule_search_locations or []) if spec else []:
        program = Path(folder) / ("rerun.exe" if sys.platform == "win32" else "rerun")
        if program.is_file():
            return [str(program), *options]
    return [sys.executable, "-m", "rerun", *options]


@contextlib.contextmanager
def started(command: list[str], **how: Any) -> Iterator[subprocess.Popen[str]]:
    """Run a program that ends with the `with` statement at the latest, and with Ctrl-C."""
    with subprocess.Popen(command, text=True, **how) as process:  # noqa: S603

        def end() -> None:
            process.kill()
            with contextlib.suppress(ChildProcessError):
                os.waitpid(process.pid, 0)  # `wait` may be what was interrupted, and holds its lock

        with before_interrupt(end):
            try:
                yield process
            finally:
                process.kill()
                process.wait()


def check_recording(path: Path) -> None:
    """Refuse what the viewer would show as an empty window.

    Raises:
        InputError: the file is no recording, is cut off, or is damaged inside.
    """
    with path.open("rb") as file:
        head = file.read(len(MAGIC))
        file.seek(max(0, path.stat().st_size - _TAIL_BYTES))
        tail = file.read()
    if head in OLD_MAGIC:
        raise InputError(f"{path}: a recording of an older Rerun; `rerun rrd migrate` makes it readable")
    if head != MAGIC:
        raise InputError(f"{path}: is no Rerun recording; a .rrd file, a map or run folder, or a log was wanted")
    if FOOT not in tail:
        raise InputError(f"{path}: the recording is cut off, or was never finished; make it anew from its log")
    done = _verified(path)
    if done is not None and done.returncode != 0:
        reason = next((line for line in done.stderr.splitlines() if path.name in line), "it cannot be decoded")
        reason = reason.rpartition('.rrd"')[2].strip(" :") or reason
        raise InputError(f"{path}: the recording is damaged ({reason})")


def _verified(path: Path) -> subprocess.CompletedProcess[str] | None:
    """Return what Rerun says of a recording; None where that takes too long, or this Rerun cannot tell."""
    command = viewer("rrd", "verify", str(path))
    with started(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            output, errors = process.communicate(timeout=_CHECK_LIMIT_S)
        except subprocess.TimeoutExpired:
            return None
    return subprocess.CompletedProcess(command, process.returncode, output, errors)
