"""How a recording gets to the disk, and what is said where it does not.

Where the disk is full, Rerun's own thread ends with a line of its log, and closing the stream waits for it for ever.
"""

from __future__ import annotations

import importlib
import os
import shutil
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError

_FLUSH_S, _MOST_STALLS, _ROOM_BYTES = 3.0, 8, 1_000_000
_LEFT_OPEN: list[Any] = []  # streams that cannot be closed: letting go of one waits for ever, too


def load_quietly() -> Any:
    """Return the module of Rerun, without the lines of its log: what goes wrong is told by `write_out`."""
    unset = "RUST_LOG" not in os.environ
    if unset:
        os.environ["RUST_LOG"] = "off"  # is read once, when Rerun is loaded
    try:
        return importlib.import_module("rerun")
    finally:
        if unset:
            del os.environ["RUST_LOG"]


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
