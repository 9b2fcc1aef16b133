"""Topics and messages of a ROS 2 bag from the pages of a damaged SQLite file."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from lhdmap.errors import InputError
from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import MAX_TIME_NS
from lhdmap.logs.container import Contents
from lhdmap.logs.sqlite.pages import PagePlace, PageRow, Pages


class _Found(NamedTuple):
    """One message: sorted by log time, then by row."""

    time_ns: int
    rowid: int
    topic: int
    place: PagePlace


class Salvage:
    """What the pages of a damaged file hold: the index is kept in memory, messages are read when asked for."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        self._pages = Pages(self._file, path.stat().st_size)
        self._channels: dict[int, Channel] = {}
        found: dict[int, _Found] = {}
        for place, row in self._pages.rows():
            message = _message(row, place)
            if message is not None:
                found.setdefault(message.rowid, message)
            else:
                self._add_topic(row)
        self._found = sorted(message for message in found.values() if message.topic in self._channels)

    def contents(self) -> Contents:
        """Return topics, counts and log times."""
        counts: dict[int, int] = {}
        for message in self._found:
            counts[message.topic] = counts.get(message.topic, 0) + 1
        times = (self._found[0].time_ns, self._found[-1].time_ns) if self._found else (None, None)
        return Contents(self._channels, counts, *times)

    def messages(self, wanted: Collection[int], after: tuple[int, int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, topic id and bytes of the messages after this (log time, row)."""
        for message in self._found:
            if message.topic not in wanted or (message.time_ns, message.rowid) <= after:
                continue
            try:
                data = self._pages.row(message.place).columns[3]
            except (InputError, IndexError):
                continue
            if isinstance(data, bytes):
                yield message.time_ns, message.topic, data

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _add_topic(self, row: PageRow) -> None:
        """Take in a row (id, name, type, serialization format, ...) of the table of topics."""
        texts = [value.decode("utf-8", "replace") for value in row.columns[1:4] if isinstance(value, bytes)]
        if len(texts) == 3 and row.columns[0] is None and "/" in texts[1] and texts[2].isalnum():
            self._channels.setdefault(row.rowid, Channel(*texts))


def _message(row: PageRow, place: PagePlace) -> _Found | None:
    """Return the message that a row (id, topic, log time, data) of the table of messages is, None for another row."""
    if len(row.columns) != 4 or row.columns[0] is not None:
        return None
    _, topic, time_ns, data = row.columns
    if not (isinstance(topic, int) and isinstance(time_ns, int) and isinstance(data, bytes)):
        return None
    return _Found(time_ns, row.rowid, topic, place) if 0 <= time_ns <= MAX_TIME_NS else None
