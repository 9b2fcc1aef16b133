"""What a worker does and says: one command line, its exit code, its JSON object, what it printed besides."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple


class JobOutcome(NamedTuple):
    """What came of a command line: exit code, the object of `--json`, what it said on standard error, figures of its folder."""

    exit_code: int
    values: Mapping[str, Any]
    said: str = ""
    figures: Mapping[str, Any] = {}


class BatchJob(NamedTuple):
    """A command line with a key of its own."""

    key: str
    words: tuple[str, ...]


class Ran(NamedTuple):
    """A job that is over: its outcome, or why there is none; how often a worker died of it; seconds it took."""

    key: str
    outcome: JobOutcome | None
    reason: str
    killed: int
    wall_s: float


Work = Callable[[Sequence[str]], JobOutcome]
"""A function that can be sent to another process."""
Runner = Callable[[Sequence[BatchJob], Work], Iterator[Ran]]
"""Yields each job once, as it ends, in any order."""


class Warm(NamedTuple):
    """What makes kernels ready on a node, a function that can be sent there, and who hears of it."""

    call: Callable[[], object]
    told: Callable[[str], None]


def needs_kernels(jobs: Sequence[BatchJob]) -> bool:
    """Return whether any of the jobs matches scans: the others start at once."""
    return any(job.words[0] in ("build-map", "localize") for job in jobs)
