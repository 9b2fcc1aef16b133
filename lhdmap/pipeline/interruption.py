"""Ctrl-C as a wish that is heard between two messages."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import Any, Self

from lhdmap.interrupts import GIVE_WAY

_LEAST_S = 5.0


class Interruption:
    """While entered, the first Ctrl-C only sets `asked`; a second one does at once what it would have done without this.

    Raised wherever the program happens to be, KeyboardInterrupt would leave locks of the compiler held (llvmlite's), and the
    thread that integrates would wait for them for ever. Outside of the main thread, or where the caller handles the signal,
    nothing changes.

    In the program what is done after the first Ctrl-C takes at most half as long as the run until then, or 5 s, and ends like
    with a second one: the kernels of a first run are compiled for a minute and more, for the little that was read.
    """

    def __init__(self) -> None:
        self.asked = False
        self._before: Any = None
        self._started_s = time.monotonic()

    def __enter__(self) -> Self:
        """Take over the signal where it is Python's own to handle."""
        before = signal.getsignal(signal.SIGINT)
        if threading.current_thread() is threading.main_thread() and before in GIVE_WAY:
            self._before = before
            signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the signal back."""
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    @contextlib.contextmanager
    def comes_first(self) -> Iterator[None]:
        """Within, a run that was asked to end ends as interrupted, whatever went wrong after that with the little there is.

        Raises:
            KeyboardInterrupt: it was asked to end.
        """
        try:
            yield
        except Exception as error:
            if self.asked:
                raise KeyboardInterrupt from error
            raise
        if self.asked:
            raise KeyboardInterrupt

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            self._before(number, frame)
        self.asked = True
        if self._before is not signal.default_int_handler and hasattr(signal, "setitimer"):
            signal.signal(signal.SIGALRM, self._before)
            signal.setitimer(signal.ITIMER_REAL, max(_LEAST_S, 0.5 * (time.monotonic() - self._started_s)))
