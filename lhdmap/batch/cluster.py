"""Jobs on the workers of a dask scheduler: same paths, same version of lhdmap on all of them."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from lhdmap.batch.pool import RETRIES
from lhdmap.batch.work import Job, Ran, Work
from lhdmap.errors import InputError, UsageError

_CONNECT_S = 10.0
_LOOK_S = 5.0
PATIENCE_S = 300.0  # without any worker


def check_installed() -> None:
    """Raise UsageError with the line that installs it where dask.distributed is not there."""
    if importlib.util.find_spec("distributed") is None:
        raise UsageError("--cluster needs dask.distributed, which is not installed: pip install 'lhdmap[cluster]'")


def run_on_cluster(
    jobs: Sequence[Job], work: Work, address: str, told: Callable[[str], None], patience_s: float = PATIENCE_S
) -> Iterator[Ran]:
    """Yield each job as it ends on a worker of the scheduler at `address`; what dies is tried again there.

    `told` hears when there are no workers.

    Raises:
        UsageError: dask.distributed is not installed.
        InputError: nobody answers at the address, or there were no workers for too long.
    """
    check_installed()
    import distributed

    try:
        client = distributed.Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(f"--cluster {address}: no scheduler answers there: {error}") from error
    with client:
        began_s = time.monotonic()
        futures = {
            client.submit(
                work, job.words, key=f"lhdmap-{number}-{job.key}-{time.time_ns()}", retries=RETRIES, pure=False
            ): job
            for number, job in enumerate(jobs)
        }
        ended = distributed.as_completed(futures)
        yield from _collected(client, ended, futures, told, patience_s, began_s)


def _collected(
    client: Any, ended: Any, futures: dict[Any, Job], told: Callable[[str], None], patience_s: float, began_s: float
) -> Iterator[Ran]:
    left, seen_s = len(futures), time.monotonic()
    while left:
        try:
            ended.timeout = time.time() + _LOOK_S
            future = next(ended)
        except TimeoutError:
            if client.scheduler_info().get("workers"):
                seen_s = time.monotonic()
            elif time.monotonic() - seen_s > patience_s:
                raise InputError(
                    f"the cluster has had no workers for {patience_s:.0f} s: {left} rows are left"
                ) from None
            else:
                told("the cluster has no workers: waiting for some")
            continue
        left, seen_s = left - 1, time.monotonic()
        job, wall_s = futures[future], time.monotonic() - began_s
        if future.status == "finished":
            yield Ran(job.key, future.result(), "", 0, wall_s)
        else:
            error = future.exception()
            killed = RETRIES + 1 if type(error).__name__ == "KilledWorker" else 0
            yield Ran(job.key, None, f"{type(error).__name__}: {error}", killed, wall_s)
