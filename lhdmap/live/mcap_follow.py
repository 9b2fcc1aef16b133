"""An MCAP file that grows: read record by record, waiting where it ends so far."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import McapError
from mcap.records import Channel, DataEnd, Message, Schema
from mcap.stream_reader import StreamReader

from lhdmap.errors import InputError
from lhdmap.live.source import Announced, LiveMessage, Sink
from lhdmap.logs.mcap.records import ros2_type

QUIET_S = 30.0
_LOOK_S = 0.002  # a growing file tells nobody: it is looked at 500 times a second (1 % of a core)


class _Ended(Exception):
    """Nothing more will come."""


class GrowingFile:
    """A file whose `read` waits until the bytes are there; `seek` is not needed."""

    def __init__(self, file: IO[bytes], stop: threading.Event, quiet_s: float) -> None:
        self._file, self._stop, self._quiet_s = file, stop, quiet_s

    def read(self, size: int = -1) -> bytes:
        """Return `size` bytes.

        Raises:
            _Ended: they did not come within the quiet time, or the end was asked for.
        """
        found = self._file.read(size)
        waited_from_s = time.monotonic()
        while len(found) < size:
            more = self._file.read(size - len(found))
            if more:
                found, waited_from_s = found + more, time.monotonic()
            elif time.monotonic() - waited_from_s > self._quiet_s or self._stop.wait(_LOOK_S):
                raise _Ended
        return found


class McapFollow:
    """A `LiveSource`: a file that somebody else writes. It ends with the file's data, or after a quiet time."""

    waits = True

    def __init__(self, path: Path, quiet_s: float = QUIET_S) -> None:
        self.address = f"mcap:{path}"
        self._path, self._quiet_s = path, quiet_s

    def run(self, sink: Sink, stop: threading.Event) -> None:
        """Put the file's messages into the sink as they are written.

        Raises:
            InputError: the file did not appear, or is no MCAP file.
        """
        if not self._appeared(sink, stop):
            return
        with self._path.open("rb", buffering=0) as file:
            stream: Any = GrowingFile(file, stop, self._quiet_s)
            schemas: dict[int, Schema] = {}
            channels: dict[int, Announced] = {}
            try:
                for record in StreamReader(stream).records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        channels[record.id] = _announced(record, schemas.get(record.schema_id))
                        sink.announce(channels[record.id])
                    elif isinstance(record, Message):
                        topic, kind, encoding, _ = channels[record.channel_id]
                        sink.put(LiveMessage(topic, kind, record.log_time, record.data, encoding))
                    elif isinstance(record, DataEnd):
                        return
            except _Ended:
                if not stop.is_set():
                    sink.say(f"{self._path}: nothing was written for {self._quiet_s:.0f} s: taken for the end")
            except (McapError, KeyError) as error:
                raise InputError(f"{self._path}: not an MCAP file that can be followed: {error}") from error

    def _appeared(self, sink: Sink, stop: threading.Event) -> bool:
        """Wait for the file, and say so; return whether it is there."""
        began_s = time.monotonic()
        if not self._path.exists():
            sink.say(f"{self._path}: not there yet; waiting for it, {self._quiet_s:.0f} s at most (--quiet-end)")
        while not self._path.exists():
            if stop.wait(0.05):
                return False
            if time.monotonic() - began_s > self._quiet_s:
                raise InputError(f"{self._path}: no such file, also not after {self._quiet_s:.0f} s")
        return True


def _announced(channel: Channel, schema: Schema | None) -> Announced:
    kind = "unknown" if schema is None else ros2_type(schema.name)
    text = "" if schema is None else schema.data.decode("utf-8", "replace")
    return Announced(channel.topic, kind, channel.message_encoding, text)
