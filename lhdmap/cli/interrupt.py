"""Ctrl-C in the program: it ends at once, with exit code 4, wherever it is; what is half done is removed or named before."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from lhdmap.cli.console import Console
from lhdmap.interrupts import GIVE_WAY, put_in_order

EXIT_INTERRUPTED = 4
_program: list[int] = []  # the process that this is about: one that was forked must not put anything in order


def take_over() -> None:
    """End the program inside the handler from now on: raised anywhere, KeyboardInterrupt would meet libraries that fail at it."""
    _program[:] = [os.getpid()]
    GIVE_WAY.append(_end)
    signal.signal(signal.SIGINT, _end)


def told(kept: Sequence[Path]) -> str:
    """Return what a person is told; only where something is kept is that said."""
    places = [path for path in kept if not any(other in path.parents for other in kept)]
    if not places:
        return "interrupted"
    return f"interrupted; what was finished is kept in {', '.join(dict.fromkeys(map(str, places)))}"


def _end(_number: int, _frame: FrameType | None) -> None:
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if os.getpid() in _program:
            _put_in_order()
    finally:
        os._exit(EXIT_INTERRUPTED)


def _put_in_order() -> None:
    text = told(put_in_order())
    try:
        (Console.current or Console()).fail("interrupted", text, EXIT_INTERRUPTED)
        sys.stdout.flush()
    except Exception:  # noqa: BLE001  # where it came in the middle of writing, the stream refuses
        os.write(2, f"lhdmap: {text}\n".encode(errors="surrogateescape"))
    _end_children()


def _end_children() -> None:
    """End processes that were started for this one: nobody would read what they write."""
    if "multiprocessing" in sys.modules:
        import multiprocessing

        for child in multiprocessing.active_children():
            child.kill()
