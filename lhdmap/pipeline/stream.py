"""A log that is still being written: what `build_map` and `localize` take instead of one that is complete."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

from lhdmap.logs.base import LogReader
from lhdmap.logs.source import LogSource
from lhdmap.messages import Message
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.mapping import MappingPipeline


class Stream(Protocol):
    """The messages of a running machine; when they end, the log that they were recorded in is complete.

    `live_port`: where viewers on this machine may follow the recording, None for none.
    """

    live_port: int | None

    def opened(self, path: Path) -> LogReader:
        """Return the reader of the log that grows at `path`; entered, it waits until a scanner has been seen for a while."""
        ...

    def through(
        self, source: LogSource, messages: Iterable[tuple[str, Message]], stages: MappingPipeline | Localizer
    ) -> Iterator[tuple[str, Message]]:
        """Yield the messages of the source as they come; `stages` have taken each before the next is asked for."""
        ...
