"""Jobs on the cores of this machine: each worker is a pool of one process, so that a dead one is that of a known job."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple

from lhdmap.batch.limits import LOOK_S, Limits
from lhdmap.batch.work import BatchJob, JobOutcome, Ran, Warm, Work, needs_kernels
from lhdmap.interrupts import obey, undisturbed

RETRIES = 1
NO_LIMITS = Limits()
_JOBS_A_PROCESS = 20  # then a new one: what libraries keep adds up to a quarter more memory in eighteen maps


class _Running(NamedTuple):
    worker: _Worker
    job: BatchJob
    killed: int
    began_s: float


class _Worker:
    """A process that takes one job at a time, and is replaced where it died or has done many."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._pid: Future[int] | None = None
        self._jobs = 0

    @property
    def process(self) -> int | None:
        """The number of the process, None as long as there is none."""
        known = self._pid is not None and self._pid.done() and not self._pid.exception()
        return self._pid.result() if known and self._pid is not None else None

    def submit(self, call: Callable[..., Any], *arguments: object) -> Future[Any]:
        """Begin a job."""
        if self._jobs >= _JOBS_A_PROCESS:
            self.end()
        try:
            return self._submitted(call, *arguments)
        except BrokenProcessPool:  # it died between two jobs
            self.end()
            return self._submitted(call, *arguments)

    def _submitted(self, call: Callable[..., Any], *arguments: object) -> Future[Any]:
        with undisturbed():  # the process must not hear Ctrl-C before it can ignore it
            if self._pool is None:
                spawn = multiprocessing.get_context("spawn")  # a fork would copy locks of threads
                self._pool, self._jobs = ProcessPoolExecutor(1, spawn, initializer=obey), 0
                self._pid = self._pool.submit(os.getpid)
            self._jobs += 1
            return self._pool.submit(call, *arguments)

    def end(self, *, kill: bool = False) -> None:
        """Let the process go, or end it, whatever it does."""
        if self._pool is None:
            return
        process = self.process
        if kill and process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        self._pool.shutdown(
            wait=not kill or process is not None, cancel_futures=True
        )  # else its semaphores are left behind
        self._pool = self._pid = None


def run_here(
    jobs: Sequence[BatchJob],
    work: Work,
    workers: int,
    retries: int = RETRIES,
    limits: Limits = NO_LIMITS,
    warm: Warm | None = None,
) -> Iterator[Ran]:
    """Yield each job as it ends; one whose worker is killed is tried again, at the end, `retries` times.

    One that is over a limit is ended and not tried again. `warm` is run once before the jobs where several workers would
    compile the same kernels.
    """
    left = deque((job, 0) for job in jobs)
    free = [_Worker() for _ in range(max(1, min(workers, len(jobs))))]
    running: dict[Future[JobOutcome], _Running] = {}
    try:
        if warm is not None and len(jobs) > len(free) > 1 and needs_kernels(jobs):
            _warmed(free[-1], warm)
        while left or running:
            while left and free:
                job, killed = left.popleft()
                worker = free.pop()
                running[worker.submit(work, job.words)] = _Running(worker, job, killed, time.monotonic())
            for future, ran in _over(running, limits):
                one = running.pop(future)
                free.append(one.worker)
                if ran.outcome is None and one.killed < ran.killed <= retries:
                    left.append((one.job, ran.killed))
                else:
                    yield ran
    finally:
        for one in running.values():
            one.worker.end(kill=True)
        for worker in free:
            worker.end()


def _over(running: Mapping[Future[JobOutcome], _Running], limits: Limits) -> Iterator[tuple[Future[JobOutcome], Ran]]:
    """Yield what has ended or been ended since; wait for the first one, or for the next look at the limits."""
    ended = wait(running, timeout=LOOK_S if limits.any else None, return_when=FIRST_COMPLETED).done
    for future in ended:
        yield future, _ended(future, running[future])
    for future in [one for one in running if one not in ended] if limits.any else ():
        one, process = running[future], running[future].worker.process
        wall_s = time.monotonic() - one.began_s
        if process is not None and (why := limits.passed(process, wall_s)):
            one.worker.end(kill=True)
            yield future, Ran(one.job.key, None, f"ended: {why}", one.killed, wall_s)


def _warmed(worker: _Worker, warm: Warm) -> None:
    """Have the kernels compiled and kept on disk; a failure is left to the rows, which meet the same."""
    warm.told("kernels are made ready, once on this machine")
    began_s, future = time.monotonic(), worker.submit(warm.call)
    try:
        failure = future.exception()
    except BaseException:  # Ctrl-C
        worker.end(kill=True)
        raise
    if failure is None:
        warm.told(f"kernels ready in {time.monotonic() - began_s:.1f} s")
        return
    worker.end()
    warm.told(f"kernels are left to the rows: {type(failure).__name__}: {failure}")


def _ended(future: Future[JobOutcome], one: _Running) -> Ran:
    wall_s = time.monotonic() - one.began_s
    try:
        return Ran(one.job.key, future.result(), "", one.killed, wall_s)
    except BrokenProcessPool:
        one.worker.end()
        killed = one.killed + 1
        times = "" if killed == 1 else f" {killed} times"
        return Ran(one.job.key, None, f"its process was killed{times} (out of memory?)", killed, wall_s)
    except Exception as error:  # noqa: BLE001  # whatever a job raises costs that job
        return Ran(one.job.key, None, f"{type(error).__name__}: {error}", one.killed, wall_s)
