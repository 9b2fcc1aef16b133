"""What a row may take: time, and memory of its process with all that it starts."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from lhdmap.errors import UsageError

LOOK_S = 0.25  # between two looks: what a process takes in less is seen late
_PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Limits:
    """Most seconds and most resident memory (GiB) of a row; None is without a limit.

    Raises:
        UsageError: one is not positive, or this system does not tell the memory of a process.
    """

    row_time_s: float | None = None
    memory_gib: float | None = None

    def __post_init__(self) -> None:
        """Check both."""
        for name, value in (("--row-time-s", self.row_time_s), ("--memory-limit-gib", self.memory_gib)):
            if value is not None and not value > 0.0:
                raise UsageError(f"{name} {value:g}: more than 0 was wanted")
        if self.memory_gib is not None and not (_PROC / "self" / "statm").is_file():
            raise UsageError(
                "--memory-limit-gib: this system has no /proc to read the memory of a process from; leave it out"
            )

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return self.row_time_s is not None or self.memory_gib is not None

    def passed(self, process: int, seconds: float) -> str:
        """Return what limit the row of a process is over, in words; empty where it is within both."""
        if self.row_time_s is not None and seconds > self.row_time_s:
            return f"it took more than {self.row_time_s:g} s (--row-time-s)"
        if self.memory_gib is not None and (seen := memory_gib(process)) > self.memory_gib:
            return f"it took {seen:.2f} GiB of memory, more than {self.memory_gib:g} (--memory-limit-gib)"
        return ""


def memory_gib(process: int) -> float:
    """Return the resident memory of a process and of all that it has started, 0 where it is gone."""
    total = 0.0
    with contextlib.suppress(OSError):
        words = (_PROC / str(process) / "statm").read_text(encoding="ascii").split()
        total += int(words[1]) * os.sysconf("SC_PAGE_SIZE") / 2**30
        for file in (_PROC / str(process) / "task").glob("*/children"):
            total += sum(memory_gib(int(child)) for child in file.read_text(encoding="ascii").split())
    return total
