"""Rerun, and how a recording gets to the disk; what is said where it does not.

Without Rerun (extra `view`) recordings are left out: what draws them is handed `Absent`, and a warning says so.
Where the disk is full, Rerun's own thread ends with a line of its log, and closing the stream waits for it for ever.
"""

from __future__ import annotations

import os
import shutil
import sys
import warnings
from pathlib import Path
from typing import Any, Self

from lhdmap.errors import InputError, LhdmapWarning
from lhdmap.extras import install_line, is_installed, library

_FLUSH_S, _MOST_STALLS, _ROOM_BYTES = 3.0, 8, 1_000_000
_LEFT_OPEN: list[Any] = []  # streams that cannot be closed: letting go of one waits for ever, too


class Absent:
    """Stands for Rerun where it is not installed: each of its members, and what each call returns, is this again."""

    def __getattr__(self, _name: str) -> Self:
        return self

    def __call__(self, *_: object, **__: object) -> Self:
        """Return this, whatever is asked for."""
        return self


def rerun() -> Any:
    """Return the module of Rerun, `Absent` where it is not installed.

    It is without the lines of its own log: what goes wrong is told by `write_out`.

    Raises:
        InstallationError: it is there and cannot be loaded.
    """
    if not is_installed("rerun"):
        return Absent()
    unset = "RUST_LOG" not in os.environ and "rerun" not in sys.modules
    if unset:
        os.environ["RUST_LOG"] = "off"  # is read once, when Rerun is loaded
    try:
        return library("rerun")
    finally:
        if unset:
            del os.environ["RUST_LOG"]


def left_out(name: str = "recording.rrd") -> list[str]:
    """Return the warning that there will be no recording; none where there will be one."""
    return [] if is_installed("rerun") else [f"{name} is left out: {install_line('rerun')}"]


def warn_if_left_out(path: Path) -> None:
    """Warn that a recording will not be written."""
    for text in left_out(path.name):
        warnings.warn(text, LhdmapWarning, stacklevel=3)


def write_out(stream: Any, path: Path) -> None:
    """Have all of a recording written, and close it.

    Raises:
        InputError: the file does not grow any more, and not all is in it.
    """
    size, stalls = -1, 0
    while not _flushed(stream):
        before, size = size, path.stat().st_size if path.exists() else 0
        stalls = stalls + 1 if size == before else 0
        full = shutil.disk_usage(path.parent).free < _ROOM_BYTES
        if full or stalls >= _MOST_STALLS:
            _LEFT_OPEN.append(stream)
            reason = "the disk is full" if full else "is the disk full?"
            raise InputError(
                f"{path}: the recording cannot be written, {reason}; make room, or name another place with -o"
            )
    stream.disconnect()


def _flushed(stream: Any) -> bool:
    try:
        stream.flush(timeout_sec=_FLUSH_S)
    except RuntimeError:
        return False
    return True
