"""`LogWriter`: our messages into an MCAP log (ROS 2 CDR, zstd chunks, schemas included) that ROS tools read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from lhdmap import __version__
from lhdmap.errors import InputError, UsageError
from lhdmap.logs.ros_messages import definition, serialized
from lhdmap.messages import Message, Mount

_CHUNK_BYTES = 1 << 20


class LogWriter:
    """Writes one log; a context manager.

    The file has the name `PATH.partial` until the `with` statement ends well; when that is left by an exception, the
    partial file is finished (it can be read) but keeps that name. `metadata` goes into the file's metadata record.
    """

    def __init__(self, path: Path | str, metadata: Mapping[str, str] | None = None) -> None:
        self.path = Path(path)
        self.partial_path = self.path.with_name(self.path.name + ".partial")
        self._metadata = {"software": f"lhdmap {__version__}", **(metadata or {})}
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[int, str]] = {}
        self._count = 0
        self._first_ns = 0

    def __enter__(self) -> Self:
        """Create the file; raises UsageError where one with the final name exists."""
        if self.path.exists():
            raise UsageError(f"{self.path} exists already and is not overwritten; give another name or remove it")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.partial_path.open("wb")
        self._writer = Writer(self._file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=f"lhdmap {__version__}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file, and give it its name where all went well."""
        text = "\n".join(f"{key}: {value}" for key, value in self._metadata.items()) + "\n"
        self._writer.add_metadata("lhdmap", dict(self._metadata))
        self._writer.add_attachment(self._first_ns, self._first_ns, "lhdmap.txt", "text/plain", text.encode())
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        if kind is None:
            self.partial_path.replace(self.path)

    def write(self, topic: str, message: Message | list[Mount], log_time_ns: int | None = None) -> None:
        """Add one message (several mounts make one TFMessage); its log time is its stamp by default, nanoseconds.

        Raises:
            InputError: the topic holds another type already.
        """
        type_name, data = serialized(message)
        channel, known = self._channels.get(topic) or self._register(topic, type_name)
        if known != type_name:
            raise InputError(f"{self.path}: topic {topic} holds {known}; a {type_name} cannot be written to it")
        if log_time_ns is None:
            log_time_ns = message[0].stamp_ns if isinstance(message, list) else message.stamp_ns
        self._first_ns = self._first_ns or log_time_ns
        self._count += 1
        self._writer.add_message(channel, log_time_ns, data, log_time_ns, sequence=self._count & 0xFFFFFFFF)

    def _register(self, topic: str, type_name: str) -> tuple[int, str]:
        schema = self._schemas.get(type_name)
        if schema is None:
            schema = self._schemas[type_name] = self._writer.register_schema(
                type_name, "ros2msg", definition(type_name).encode()
            )
        entry = self._channels[topic] = (self._writer.register_channel(topic, "cdr", schema), type_name)
        return entry
