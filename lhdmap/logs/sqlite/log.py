"""ROS 2 bags in SQLite files (`.db3`), whole or cut off; messages compressed one by one (zstd) as well."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from urllib.parse import quote

import numpy as np

from lhdmap.errors import InputError
from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import MAX_TIME_NS
from lhdmap.logs.compression import inflated
from lhdmap.logs.container import Contents
from lhdmap.logs.findings import Findings
from lhdmap.logs.order import clock_was_set_back
from lhdmap.logs.sqlite.salvage import Salvage

MAGIC = b"SQLite format 3\0"
_MAX_MESSAGE_BYTES = 256 << 20
# What the sqlite3 module raises for a damaged file (names in the schema that are no text among it).
_DAMAGED = (sqlite3.Error, UnicodeDecodeError, OverflowError)
_PAGE_SIZE, _PAGE_COUNT, _CHANGE_COUNTER, _VALID_FOR = slice(16, 18), slice(28, 32), slice(24, 28), slice(92, 96)
_TOPICS = "SELECT id, name, type, serialization_format FROM topics"
_COUNTS = "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id"
_MESSAGES = "SELECT id, topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
_AS_WRITTEN = "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id"
_TIMES = "SELECT timestamp, topic_id FROM messages ORDER BY id"


class SqliteFile:
    """An open `.db3` (a `Container`)."""

    format = "ROS 2 bag (sqlite3)"

    def __init__(self, path: Path, damage: Findings) -> None:
        self._path, self._damage, self.remarks = path, damage, Findings()
        with path.open("rb") as file:
            header = file.read(100)
        if not header.startswith(MAGIC):
            raise InputError(f"{path}: not an SQLite file (its first bytes are not SQLite's); is it another format?")
        self._database: sqlite3.Connection | None = None
        self._salvage: Salvage | None = None
        self._contents: Contents | None = None
        self._set_back: bool | None = None
        if _is_cut(header, path.stat().st_size):
            damage.add(f"cut off at byte {path.stat().st_size}: the end of the database is missing")
            self._start_salvage()
        else:
            self._database = _connect(path)

    def contents(self) -> Contents:
        """Return topics, counts and log times."""
        if self._contents is None and self._database is not None:
            try:
                self._contents = _stated(self._database)
            except (*_DAMAGED, InputError) as error:
                self._damage.add(f"the database is damaged ({error}): its pages are searched for messages")
                self._start_salvage()
        if self._contents is None:
            self._contents = self._need_salvage().contents()
        return self._contents

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, topic id and bytes in log-time order; in the order of writing where the clock was set back."""
        self.contents()
        keep = frozenset(wanted)
        last = (-1, -1)
        if self._database is not None and self._salvage is None:
            try:
                for rowid, topic, time_ns, data in self._database.execute(self._query()):
                    last = (time_ns, rowid)
                    if topic in keep and _valid(time_ns, data):
                        yield time_ns, topic, inflated(data)
            except _DAMAGED as error:
                self._damage.add(f"the database is damaged ({error}): its pages are searched for messages")
            else:
                return
        for time_ns, topic, data in self._need_salvage().messages(keep, after=last):
            yield time_ns, topic, inflated(data)

    def _query(self) -> str:
        """Return how to ask for the messages."""
        assert self._database is not None  # noqa: S101  # asked for where there is one
        if self._set_back is None:
            rows = [row for row in self._database.execute(_TIMES) if all(isinstance(value, int) for value in row)]
            times, topics = np.array(rows, dtype=np.int64).reshape(-1, 2).T
            self._set_back = clock_was_set_back(times, topics)
        return _AS_WRITTEN if self._set_back else _MESSAGES

    def close(self) -> None:
        """Close the file."""
        if self._database is not None:
            self._database.close()
        if self._salvage is not None:
            self._salvage.close()

    def _start_salvage(self) -> None:
        self._salvage = Salvage(self._path)

    def _need_salvage(self) -> Salvage:
        if self._salvage is None:
            self._start_salvage()
        assert self._salvage is not None  # noqa: S101  # just set
        return self._salvage


def _connect(path: Path) -> sqlite3.Connection:
    """Open the database for reading only; a write-ahead log beside it is used."""
    log = path.with_name(path.name + "-wal")
    immutable = "" if log.exists() and log.stat().st_size else "&immutable=1"
    try:
        database = sqlite3.connect(
            f"file:{quote(os.fsencode(path))}?mode=ro{immutable}", uri=True, check_same_thread=False
        )
    except sqlite3.Error as error:
        raise InputError(f"{path}: the database cannot be opened ({error})") from error
    database.text_factory = lambda raw: raw.decode("utf-8", "replace")
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _MAX_MESSAGE_BYTES)
    return database


def _is_cut(header: bytes, size: int) -> bool:
    """Return whether the file is shorter than its header says (where that is known to hold)."""
    if len(header) < 100 or header[_CHANGE_COUNTER] != header[_VALID_FOR]:
        return len(header) < 100
    page_bytes = int.from_bytes(header[_PAGE_SIZE], "big")
    return size < int.from_bytes(header[_PAGE_COUNT], "big") * (65536 if page_bytes == 1 else page_bytes)


def _stated(database: sqlite3.Connection) -> Contents:
    kinds = dict(database.execute("SELECT name, type FROM sqlite_master WHERE name IN ('topics', 'messages')"))
    if kinds != {"topics": "table", "messages": "table"}:
        raise InputError("no tables 'topics' and 'messages' as in a ROS 2 bag")
    channels = {}
    for number, name, kind, encoding in database.execute(_TOPICS):
        if not (isinstance(number, int) and all(isinstance(text, str) for text in (name, kind, encoding))):
            raise InputError("a topic that is no topic")
        channels[number] = Channel(name, kind, encoding)
    rows = [row for row in database.execute(_COUNTS) if all(isinstance(value, int) for value in row)]
    counts = {topic: count for topic, count, _, _ in rows if topic in channels}
    times = [time for row in rows for time in row[2:] if 0 <= time <= MAX_TIME_NS]
    return Contents(channels, counts, min(times, default=None), max(times, default=None))


def _valid(time_ns: object, data: object) -> bool:
    return isinstance(time_ns, int) and time_ns >= 0 and isinstance(data, bytes)
