"""What a run costs: time, memory, and how much of the time numba compiled, once after installation, for up to a minute."""

from __future__ import annotations

import resource as process_resource
import sys
import time
from types import TracebackType
from typing import Any, NamedTuple, Self

from numba.core import event

_EVENT = "numba:compile"  # kernels that come from the cache on disk do not raise it


class CompileClock(event.Listener):
    """Counts the seconds in which this process compiled, from `start` to `stop`; a kernel within a kernel counts once."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._begun = 0.0

    def start(self) -> Self:
        """Begin to listen."""
        event.register(_EVENT, self)  # type: ignore[no-untyped-call]
        return self

    def stop(self) -> None:
        """Listen no longer."""
        event.unregister(_EVENT, self)  # type: ignore[no-untyped-call]

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


class Spent(NamedTuple):
    """What a process has needed: the most memory that it had in RAM (MiB), and how long it compiled (s)."""

    memory_mib: float = 0.0
    compile_s: float = 0.0


def cost(started: float, duration_s: float, own: Spent, beside: Spent) -> dict[str, float]:
    """Return what a run that `started` at a monotonic time has cost, with what this process and one beside it needed.

    `compile_s`: of the time, what went into compiling; two processes compile at the same time, so the longer one counts.
    """
    wall_s = max(time.monotonic() - started, 1e-6)
    return {
        "wall_s": wall_s,
        "realtime_factor": duration_s / wall_s,
        "peak_memory_mib": own.memory_mib + beside.memory_mib,
        "compile_s": min(max(own.compile_s, beside.compile_s), wall_s),
    }


def peak_memory_mib() -> float:
    """Return the most memory that this process has had in RAM, MiB."""
    unit = 1024.0**2 if sys.platform == "darwin" else 1024.0
    return process_resource.getrusage(process_resource.RUSAGE_SELF).ru_maxrss / unit
