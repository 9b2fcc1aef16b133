"""An object in a process of its own, so that a second core does its work: threads of one process share Python's lock.

`Here` and `ProcessBeside` are used alike, and what comes out is the same: `tell` in order, `ask` when an answer is wanted.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, Self, TypeVar

from lhdmap.errors import LhdmapError
from lhdmap.interrupts import undisturbed


class HelperDied(LhdmapError):
    """The process beside this one has ended by itself: killed, or out of memory."""


P = ParamSpec("P")
R = TypeVar("R")
_BATCH_BYTES, _MOST_BATCHES = 100_000, 100  # switching threads for each order would cost more than the order
_PATIENCE_S = 10.0


class Served(Protocol):
    """What can be told and asked: anything that ends with `close`."""

    def close(self) -> None:
        """Keep what is finished."""
        ...


T = TypeVar("T", bound=Served)


class Here(Generic[T]):
    """The object in this process, called at once."""

    def __init__(self, make: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> None:
        self._served = make(*args, **kwargs)

    def tell(self, method: Callable[Concatenate[T, P], object], *args: P.args, **kwargs: P.kwargs) -> None:
        """Call a method of the object."""
        method(self._served, *args, **kwargs)

    def ask(self, method: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Call a method of the object and return what it returns."""
        return method(self._served, *args, **kwargs)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the object."""
        self._served.close()


class ProcessBeside(Generic[T]):
    """The object in a new process, which sees nothing of this one but the arguments; all of them are pickled.

    An error of a call that was only told, and the death of the process, come out of the next `ask`; calls in between are
    left out. Several threads may tell.
    The main module is imported anew there (`multiprocessing`, spawn): a script needs its `if __name__ == "__main__"`.
    """

    def __init__(self, make: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would copy threads' locks in the state they are in
        theirs_in, self._pipe = context.Pipe(duplex=False)
        self._answers, theirs_out = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_serve, args=(theirs_in, theirs_out, make, args, kwargs), name="lhdmap-beside", daemon=True
        )
        resource_tracker.ensure_running()  # it lets signals through when it starts
        with undisturbed():  # the new process is deaf to Ctrl-C from its first moment: this side decides what is kept
            self._process.start()
        theirs_in.close()
        theirs_out.close()
        self._told: list[bytes] = []
        self._bytes = 0
        self._alive = True
        self._lock = threading.Lock()
        self._batches: queue.Queue[list[bytes] | None] = queue.Queue(_MOST_BATCHES)
        self._writer = threading.Thread(target=self._write, name="beside", daemon=True)
        self._writer.start()

    def tell(self, method: Callable[Concatenate[T, P], object], *args: P.args, **kwargs: P.kwargs) -> None:
        """Have a method called, in order, without waiting for it."""
        self._send(False, method, args, kwargs)

    def ask(self, method: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Have a method called and return what it returns.

        Raises:
            HelperDied: the process has ended.
            Exception: whatever this call, or one before it, raised there.
        """
        self._send(True, method, args, kwargs)
        try:
            error, result = self._answers.recv()
        except (EOFError, OSError):
            raise self._died() from None
        if error is not None:
            raise error
        found: R = result
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Have the object closed and wait for the end of its process."""
        self._flush()
        self._batches.put(None)
        self._writer.join()
        self._process.join(_PATIENCE_S)
        if self._process.is_alive():
            self._process.kill()
        self._answers.close()

    def _send(self, wanted: bool, method: Callable[..., object], args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        if not self._alive:
            return
        order = pickle.dumps((wanted, method.__name__, args, kwargs), pickle.HIGHEST_PROTOCOL)
        with self._lock:
            if self._told and len(order) > _BATCH_BYTES:
                self._flush()
            self._told.append(order)
            self._bytes += len(order)
            if wanted or self._bytes > _BATCH_BYTES:
                self._flush()

    def _flush(self) -> None:
        self._batches.put(self._told)
        self._told, self._bytes = [], 0

    def _write(self) -> None:
        """Write what was told, in a thread: a process that starts, or thinks, must not hold up the teller."""
        while (batch := self._batches.get()) is not None:
            try:
                if self._alive:
                    _send_batch(self._pipe, batch)
            except OSError:  # a broken pipe must not look like that of standard output
                self._alive = False
        self._pipe.close()

    def _died(self) -> HelperDied:
        self._process.join(_PATIENCE_S)
        return HelperDied(
            f"the helper process ended (exit code {self._process.exitcode}): too little memory? "
            "--one-process does without it"
        )


def _send_batch(pipe: Connection, batch: list[bytes]) -> None:
    """Send orders; one alone, which may hold a whole map, without a copy of it, and it is let go once it is on its way."""
    if len(batch) == 1:
        pipe.send(None)
        pipe.send_bytes(batch.pop())
    else:
        pipe.send(batch)


def _orders(pipe: Connection) -> Iterator[Any]:
    """Yield what is ordered until the other side closes the pipe; what was unpacked is let go."""
    with contextlib.suppress(EOFError):
        while True:
            told: list[bytes] | None = pipe.recv()
            batch = [pipe.recv_bytes()] if told is None else told[::-1]
            while batch:
                yield pickle.loads(batch.pop())  # noqa: S301  # from our own parent


def _serve(
    orders: Connection, answers: Connection, make: Callable[..., Served], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> None:
    """Make the object and do what is ordered until the other side closes the pipe, or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where signals cannot be held back (see above)
    served, failure = _tried(make, *args, **kwargs)
    for wanted, name, args, kwargs in _orders(orders):
        result = None
        if failure is None:
            result, failure = _tried(getattr(served, name), *args, **kwargs)
        if wanted:
            answers.send((failure, result))
    if served is not None:
        served.close()
    os._exit(0)  # taking the libraries down in order would take as long as a report


def _tried(call: Callable[..., Any], *args: Any, **kwargs: Any) -> tuple[Any, Exception | None]:
    """Return the result and no error, or no result and the error, with where it came from as a note."""
    try:
        return call(*args, **kwargs), None
    except Exception as error:  # noqa: BLE001  # is raised again in the other process
        return None, _portable(error, traceback.format_exc())


def _portable(error: Exception, origin: str) -> Exception:
    """Return the error as it can be sent, with where it came from: some are pickled in part, or not at all."""
    error.add_note(origin)
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  # just made
    except Exception:  # noqa: BLE001  # whatever the reason: it cannot travel
        told = RuntimeError(f"{type(error).__name__}: {error}")
        told.add_note(origin)
        return told
    return error
