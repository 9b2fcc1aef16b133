"""Ctrl-C as a wish that is heard between two messages."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Self


class Interruption:
    """While entered, the first Ctrl-C only sets `asked`; a second one raises KeyboardInterrupt at once.

    Raised wherever the program happens to be, it would leave locks of the compiler held (llvmlite's), and the thread that
    integrates would wait for them for ever. Outside of the main thread, or where the caller handles the signal, nothing changes.
    """

    def __init__(self) -> None:
        self.asked = False
        self._replaced = False

    def __enter__(self) -> Self:
        """Take over the signal where it is Python's own to handle."""
        in_main = threading.current_thread() is threading.main_thread()
        if in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._ask)
            self._replaced = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the signal back."""
        if self._replaced:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _ask(self, _number: int, _frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
