"""Jobs on the workers of a dask scheduler: same paths, same version of lhdmap on all of them."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from lhdmap import __version__
from lhdmap.batch.nodes import check_versions, warm_nodes, workers_of
from lhdmap.batch.pool import RETRIES
from lhdmap.batch.work import BatchJob, JobOutcome, Ran, Warm, Work, needs_kernels
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
    jobs: Sequence[BatchJob],
    work: Work,
    address: str,
    told: Callable[[str], None],
    patience_s: float = PATIENCE_S,
    warm: Warm | None = None,
) -> Iterator[Ran]:
    """Yield each job as it ends on a worker of the scheduler at `address`; what dies is tried again there.

    `told` hears when there are no workers; `warm` is run once on each node before the jobs.

    Raises:
        UsageError: dask.distributed is not installed.
        InputError: nobody answers at the address, versions differ, or there were no workers for too long.
    """
    check_installed()
    distributed = library("distributed")
    try:
        client = distributed.Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(f"--cluster {address}: no scheduler answers there: {error}") from error
    with client:
        _wait_for_one(client, patience_s, len(jobs), told)
        check_versions(client)
        if warm is not None and needs_kernels(jobs):
            warm_nodes(client, warm)
        futures = {
            client.submit(
                _timed,
                work,
                job.words,
                __version__,
                key=f"lhdmap-{number}-{job.key}-{time.time_ns()}",
                retries=RETRIES,
                pure=False,
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


def _wait_for_one(client: Any, patience_s: float, left: int, told: Callable[[str], None]) -> None:
    """Wait for a first worker."""
    began_s = time.monotonic()
    while not workers_of(client):
        _seen(client, began_s, patience_s, left, told)
        time.sleep(min(_LOOK_S, 0.5 * patience_s))


def _seen(client: Any, seen_s: float, patience_s: float, left: int, told: Callable[[str], None]) -> float:
    """Return when there were workers last; raise InputError where that is too long ago."""
    if workers_of(client):
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


def _timed(work: Work, words: Sequence[str], version: str) -> tuple[JobOutcome, float]:
    """Run on a worker: the outcome and the seconds it took there; one that came later may be of another version."""
    if version != __version__:
        raise InputError(f"the worker on {platform.node()} has lhdmap {__version__}, {version} was wanted")
    began_s = time.monotonic()
    return work(words), time.monotonic() - began_s
