"""The log of a live stream, written while it comes: MCAP without chunks, so that a power cut costs what was not flushed."""

from __future__ import annotations

import time
from pathlib import Path
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from lhdmap import __version__
from lhdmap.live.source import Announced, LiveMessage
from lhdmap.logs.ros_messages import definition

_FLUSH_S = 0.1  # what a killed program loses at most
_BACK_NS = 50_000_000  # log times that fall by less are those of several threads: as `lhdmap.logs.clock` has it


class LiveRecorder:
    """Writes messages as they came, in the order in which the stages get them.

    A log sorted by its log times must have that order: one that falls is written as the one before it, and its own stays as
    the publish time. Where it falls within its topic, and by 50 ms, the clock was set back, and it stays.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: BinaryIO = path.open("wb")
        self._writer = Writer(self._file, use_chunking=False, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library=f"lhdmap {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}
        self._own_ns: dict[tuple[str, str, str], int] = {}
        self._count = self._last_ns = 0
        self._flushed_s = time.monotonic()

    def announce(self, topic: Announced) -> None:
        """Register a topic, whether or not a message of it will come."""
        key = topic.topic, topic.type_name, topic.encoding
        if key in self._channels:
            return
        schema = self._schemas.get(topic.type_name)
        if schema is None:
            text = topic.definition or _known_definition(topic.type_name)
            kind = "ros1msg" if topic.encoding == "ros1" else "ros2msg"
            schema = self._writer.register_schema(topic.type_name, kind, text.encode())
            self._schemas[topic.type_name] = schema
        self._channels[key] = self._writer.register_channel(topic.topic, topic.encoding, schema)

    def write(self, message: LiveMessage) -> LiveMessage:
        """Write a message; return it with the log time that it has in the log."""
        key = message.topic, message.type_name, message.encoding
        if key not in self._channels:
            self.announce(Announced(*key))
        own_ns = message.log_time_ns
        set_back = own_ns < self._own_ns.get(key, own_ns) - _BACK_NS
        self._own_ns[key] = own_ns
        self._last_ns = log_ns = own_ns if set_back else max(own_ns, self._last_ns)
        self._count += 1
        sequence = self._count & 0xFFFFFFFF
        self._writer.add_message(self._channels[key], log_ns, message.data, own_ns, sequence=sequence)
        now_s = time.monotonic()
        if now_s - self._flushed_s > _FLUSH_S:
            self._file.flush()
            self._flushed_s = now_s
        return message._replace(log_time_ns=log_ns)

    def close(self) -> None:
        """Finish the file."""
        if not self._file.closed:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()


def _known_definition(type_name: str) -> str:
    """Return the definition of a type that we know, empty for another."""
    try:
        return definition(type_name)
    except Exception:  # noqa: BLE001  # the type store raises what it likes for a name that it does not have
        return ""
