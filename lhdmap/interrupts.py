"""What must be done before Ctrl-C ends the program at once.

Raised wherever Python happens to be, KeyboardInterrupt is swallowed by libraries, turned into another error, or leaves their
locks held. The program `lhdmap` therefore ends inside the handler of the signal (`lhdmap.cli.interrupt`), without unwinding:
who has something to put in order says so here. In a program of somebody else nothing of this happens.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

Action = Callable[[], Path | None]
_actions: list[Action] = []
GIVE_WAY: list[Any] = [signal.default_int_handler]
"""Handlers of Ctrl-C that may be replaced for a while: Python's own, and that of the program."""


@contextlib.contextmanager
def before_interrupt(action: Action) -> Iterator[None]:
    """While entered, have `action` called before Ctrl-C ends the program; it returns where something is kept, or None."""
    _actions.append(action)
    try:
        yield
    finally:
        if action in _actions:
            _actions.remove(action)


def put_in_order() -> list[Path]:
    """Call all actions, the latest first; return what is kept, and not removed by a later one."""
    kept = []
    while _actions:
        with contextlib.suppress(Exception):  # nothing may keep the program from ending
            path = _actions.pop()()
            kept += [] if path is None else [path]
    return [path for path in kept if path.exists()]


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Hold Ctrl-C back for a moment: for steps that belong together, and for processes that are to start deaf to it.

    The mask is what a new process inherits; here another thread may still get the signal, so it is noted, and raised afterwards.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    heard: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, signal.SIG_DFL if handler is None else handler)
        if heard:
            signal.raise_signal(signal.SIGINT)


def obey() -> None:
    """In a worker: leave Ctrl-C to the process that gives the orders, and end with it.

    Nothing else would tell a worker that the other one is gone.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()


def _end_with_parent() -> None:
    import multiprocessing  # only where there are workers

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        signal.raise_signal(signal.SIGKILL)
