"""`Followed`: a source as the pipeline takes it, with its link, queue and log; and what ends it."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, Self

from lhdmap.errors import LhdmapError
from lhdmap.interrupts import GIVE_WAY
from lhdmap.live.inbox import Inbox
from lhdmap.live.link import Link
from lhdmap.live.reader import LiveContainer
from lhdmap.live.source import LiveSource
from lhdmap.live.watch import Watch
from lhdmap.logs.base import LogReader
from lhdmap.logs.decoded import DecodedLog
from lhdmap.logs.source import LogSource
from lhdmap.logs.survey import Survey
from lhdmap.messages import Message
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.mapping import MappingPipeline


class Thinned(LhdmapError):
    """The stages did not get all that is in the log."""


class Followed:
    """A `Stream` of the pipeline over a source; a context manager.

    It ends with the source, after `for_s`, or with Ctrl-C: while entered, the first one only ends the stream, and what came of
    it is finished; a second one does what it would have done without this.
    """

    def __init__(
        self,
        source: LiveSource,
        inbox: Inbox,
        observer: Watch,
        *,
        live_port: int | None = None,
        for_s: float | None = None,
    ) -> None:
        self.inbox, self.observer, self.live_port = inbox, observer, live_port
        self._link = Link(source, inbox)
        self._container = LiveContainer(inbox, self._while_waiting)
        self._for_s = for_s
        self._until_s: float | None = None
        self.survey = Survey()
        self._before: Any = None

    def __enter__(self) -> Self:
        """Start the link, and take the signal over where it is Python's own, or the program's, to handle."""
        self._link.start()
        if self._for_s is not None:
            self._until_s = time.monotonic() + self._for_s
        before = signal.getsignal(signal.SIGINT)
        if threading.current_thread() is threading.main_thread() and before in GIVE_WAY:
            self._before = before
            signal.signal(signal.SIGINT, self._asked)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the link, close the log, and give the signal back."""
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        self._link.close()

    def opened(self, path: Path) -> LogReader:
        """Return the reader of the log that grows at `path`; entered, it waits for the first seconds of a scanner."""

        def looked_at(_path: Path, _damage: object) -> LiveContainer:
            self._container.look()
            return self._container

        return DecodedLog(path, looked_at)

    def through(
        self, source: LogSource, messages: Iterable[tuple[str, Message]], stages: MappingPipeline | Localizer
    ) -> Iterator[tuple[str, Message]]:
        """Yield the messages as they come.

        Raises:
            Thinned: some were dropped, and a map is to be made, for which the log will be read once more.
        """
        self.survey = source.survey
        self._container.flow()
        for one in self.observer.through(source, messages, stages):
            yield one
            self._end_in_time()
        self._link.close()
        if self.inbox.tally.dropped and isinstance(stages, MappingPipeline):
            raise Thinned("messages were dropped")

    def _while_waiting(self) -> None:
        self.observer.look()
        self._end_in_time()

    def _end_in_time(self) -> None:
        if self._until_s is not None and time.monotonic() > self._until_s:
            self._link.stop()

    def _asked(self, _number: int, _frame: FrameType | None) -> None:
        self._link.stop()
        signal.signal(signal.SIGINT, self._before)
