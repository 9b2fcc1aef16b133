"""Jobs on the cores of this machine: each worker is a pool of one process, so that a dead one is that of a known job."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

from lhdmap.batch.work import BatchJob, JobOutcome, Ran, Work
from lhdmap.interrupts import obey, undisturbed

RETRIES = 1
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

    def submit(self, work: Work, job: BatchJob) -> Future[JobOutcome]:
        """Begin a job."""
        if self._jobs >= _JOBS_A_PROCESS:
            self.end()
        try:
            return self._submitted(work, job)
        except BrokenProcessPool:  # it died between two jobs
            self.end()
            return self._submitted(work, job)

    def _submitted(self, work: Work, job: BatchJob) -> Future[JobOutcome]:
        with undisturbed():  # the process must not hear Ctrl-C before it can ignore it
            if self._pool is None:
                spawn = multiprocessing.get_context("spawn")  # a fork would copy locks of threads
                self._pool, self._jobs = ProcessPoolExecutor(1, spawn, initializer=obey), 0
                self._pid = self._pool.submit(os.getpid)
            self._jobs += 1
            return self._pool.submit(work, job.words)

    def end(self, *, kill: bool = False) -> None:
        """Let the process go, or end it, whatever it does."""
        if self._pool is None:
            return
        pid = self._pid.result() if self._pid is not None and self._pid.done() and not self._pid.exception() else None
        if kill and pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._pool.shutdown(
            wait=not kill or pid is not None, cancel_futures=True
        )  # else its semaphores are left behind
        self._pool = self._pid = None


def run_here(jobs: Sequence[BatchJob], work: Work, workers: int, retries: int = RETRIES) -> Iterator[Ran]:
    """Yield each job as it ends; one whose worker is killed is tried again, at the end, `retries` times."""
    left = deque((job, 0) for job in jobs)
    free = [_Worker() for _ in range(max(1, min(workers, len(jobs))))]
    running: dict[Future[JobOutcome], _Running] = {}
    try:
        while left or running:
            while left and free:
                job, killed = left.popleft()
                worker = free.pop()
                running[worker.submit(work, job)] = _Running(worker, job, killed, time.monotonic())
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                one = running.pop(future)
                free.append(one.worker)
                ran = _ended(future, one)
                if ran.outcome is None and ran.killed > one.killed and ran.killed <= retries:
                    left.append((one.job, ran.killed))
                else:
                    yield ran
    finally:
        for one in running.values():
            one.worker.end(kill=True)
        for worker in free:
            worker.end()


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
