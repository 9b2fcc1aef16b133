"""How long numba compiled: once after installation, for up to a minute, which says nothing of how fast the program is."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, Self

from numba.core import event

_EVENT = "numba:compile"  # kernels that come from the cache on disk do not raise it


class CompileClock(event.Listener):  # type: ignore[misc]  # numba has no types
    """Counts the seconds in which this process compiled, from `start` to `stop`; a kernel within a kernel counts once."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._begun = 0.0

    def start(self) -> Self:
        """Begin to listen."""
        event.register(_EVENT, self)
        return self

    def stop(self) -> None:
        """Listen no longer."""
        event.unregister(_EVENT, self)

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def on_start(self, _: Any) -> None:
        """Take the begin of a compilation; numba lets one thread compile at a time."""
        if self._depth == 0:
            self._begun = time.monotonic()
        self._depth += 1

    def on_end(self, _: Any) -> None:
        """Take its end; one that had begun before this listened does not count."""
        if self._depth == 0:
            return
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.monotonic() - self._begun
