"""Jobs on the workers of a dask scheduler: same paths, same version of lhdmap on all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from lhdmap.batch.pool import RETRIES
from lhdmap.batch.work import BatchJob, JobOutcome, Ran, Work
from lhdmap.errors import InputError, UsageError
from lhdmap.extras import install_line, is_installed, library

_CONNECT_S = 10.0
_LOOK_S = 5.0
PATIENCE_S = 300.0  # without any worker


def check_installed() -> None:
    """Raise UsageError with the line that installs it where dask.distributed is not there."""
    if not is_installed("distributed"):
        raise UsageError(f"--cluster needs dask.distributed: {install_line('distributed')}")


def run_on_cluster(
    jobs: Sequence[BatchJob], work: Work, address: str, told: Callable[[str], None], patience_s: float = PATIENCE_S
) -> Iterator[Ran]:
    """Yield each job as it ends on a worker of the scheduler at `address`; what dies is tried again there.

    `told` hears when there are no workers.

    Raises:
        UsageError: dask.distributed is not installed.
        InputError: nobody answers at the address, or there were no workers for too long.
    """
    check_installed()
    distributed = library("distributed")
    try:
        client = distributed.Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(f"--cluster {address}: no scheduler answers there: {error}") from error
    with client:
        futures = {
            client.submit(
                _timed, work, job.words, key=f"lhdmap-{number}-{job.key}-{time.time_ns()}", retries=RETRIES, pure=False
            ): job
            for number, job in enumerate(jobs)
        }
        pending, seen_s = set(futures), time.monotonic()
        while pending:
            try:
                ended, pending = distributed.wait(pending, timeout=_LOOK_S, return_when="FIRST_COMPLETED")
            except TimeoutError:
                seen_s = _seen(client, seen_s, patience_s, len(pending), told)
                continue
            seen_s = time.monotonic()
            for future in ended:
                yield _ended(future, futures[future])


def _seen(client: Any, seen_s: float, patience_s: float, left: int, told: Callable[[str], None]) -> float:
    """Return when there were workers last; raise InputError where that is too long ago."""
    if client.scheduler_info().get("workers"):
        return time.monotonic()
    if time.monotonic() - seen_s > patience_s:
        raise InputError(f"the cluster has had no workers for {patience_s:.0f} s: {left} rows are left")
    told("the cluster has no workers: waiting for some")
    return seen_s


def _ended(future: Any, job: BatchJob) -> Ran:
    if future.status == "finished":
        outcome, wall_s = future.result()
        return Ran(job.key, outcome, "", 0, wall_s)
    if future.status == "cancelled":
        return Ran(job.key, None, "the scheduler has given it up", 0, 0.0)
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return Ran(job.key, None, "its workers were killed (out of memory?)", RETRIES + 1, 0.0)
    return Ran(job.key, None, f"{type(error).__name__}: {error}", 0, 0.0)


def _timed(work: Work, words: Sequence[str]) -> tuple[JobOutcome, float]:
    """Run on a worker: the outcome and the seconds it took there."""
    began_s = time.monotonic()
    return work(words), time.monotonic() - began_s
