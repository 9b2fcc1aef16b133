"""Records of an MCAP file: bytes to numbers, each length checked before it is believed (mcap.dev/spec, version 0).

A record is an opcode (1 byte), the length of its content (8 bytes) and the content, little endian.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from lhdmap.errors import InputError
from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import MAX_TIME_NS, ChunkBlock, Entry
from lhdmap.logs.compression import COMPRESSIONS

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS, DATA_END, FOOTER = 0x03, 0x04, 0x05, 0x06, 0x0B, 0x0F, 0x02
MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
CHUNK_HEAD_MAX = _CHUNK_HEAD.size + 16 + 8
_FOOTER = struct.Struct("<QQI")
_STATISTICS = struct.Struct("<QHIIIIQQI")
_COUNT = struct.Struct("<HQ")


class McapStatistics(NamedTuple):
    """The statistics record: number of messages by channel id, and their first and last log time."""

    counts: dict[int, int]
    start_ns: int
    end_ns: int


class Fields:
    """Reads the fields of one record; whatever reaches beyond its end raises InputError."""

    def __init__(self, data: bytes | memoryview) -> None:
        self._data, self._pos = memoryview(data), 0

    def take(self, layout: struct.Struct) -> tuple[int, ...]:
        """Return the numbers of `layout`."""
        start = self._pos
        if start + layout.size > len(self._data):
            raise InputError("a record that is too short")
        self._pos = start + layout.size
        return layout.unpack_from(self._data, start)

    def block(self) -> bytes:
        """Return bytes with their length (4 bytes) before them."""
        (size,) = self.take(_U32)
        start = self._pos
        if start + size > len(self._data):
            raise InputError("a record that is too short")
        self._pos = start + size
        return bytes(self._data[start : self._pos])

    def text(self) -> str:
        """Return a string."""
        return self.block().decode("utf-8", "replace")


_U16, _U32 = struct.Struct("<H"), struct.Struct("<I")
_CHANNEL_IDS = struct.Struct("<HH")


class McapTables:
    """Schemas and channels seen so far; the first definition of an id holds."""

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self._schemas: dict[int, str] = {}

    def define(self, opcode: int, content: bytes | memoryview) -> None:
        """Take in a schema or channel record; one that is broken raises InputError."""
        fields = Fields(content)
        if opcode == SCHEMA:
            (schema,) = fields.take(_U16)
            self._schemas.setdefault(schema, ros2_type(fields.text()))
        elif opcode == CHANNEL:
            channel, schema = fields.take(_CHANNEL_IDS)
            topic, encoding = fields.text(), fields.text()
            self.channels.setdefault(channel, Channel(topic, self._schemas.get(schema, "unknown"), encoding))


def ros2_type(name: str) -> str:
    """Return a message type in ROS 2 form: `sensor_msgs/LaserScan` becomes `sensor_msgs/msg/LaserScan`."""
    parts = name.replace("::", "/").strip("/").split("/")
    return f"{parts[0]}/msg/{parts[-1]}" if len(parts) in (2, 3) else name


def chunk_block(content: bytes | memoryview, offset: int, length: int) -> ChunkBlock:
    """Return the block of a chunk record whose content begins at `offset` of the file; `content`: its first bytes.

    Raises:
        InputError: it is no chunk's header.
    """
    fields = Fields(content)
    start_ns, end_ns, size, crc, name_size = fields.take(_CHUNK_HEAD)
    if name_size > 16:
        raise InputError("a chunk with an impossible header")
    name_start = _CHUNK_HEAD.size
    compression = bytes(content[name_start : name_start + name_size]).decode("ascii", "replace")
    if compression not in COMPRESSIONS or len(content) < name_start + name_size + 8:
        raise InputError("a chunk with an impossible header")
    (stored,) = struct.unpack_from("<Q", content, name_start + name_size)
    head = name_start + name_size + 8
    if stored > length - head:
        raise InputError("a chunk with an impossible size")
    return ChunkBlock(
        offset + head, stored, size, compression, crc, min(start_ns, MAX_TIME_NS), min(end_ns, MAX_TIME_NS)
    )


def statistics(content: bytes) -> McapStatistics:
    """Return the content of a statistics record; raises InputError where it is broken."""
    fields = Fields(content)
    *_, start_ns, end_ns, size = fields.take(_STATISTICS)
    pairs: list[tuple[int, int]] = [fields.take(_COUNT) for _ in range(size // _COUNT.size)]  # type: ignore[misc]
    return McapStatistics(dict(pairs), start_ns, end_ns)


def footer(content: bytes) -> tuple[int, int, int]:
    """Return summary start, summary offset start and summary CRC; raises InputError where it is broken."""
    start, offsets, crc = Fields(content).take(_FOOTER)
    return start, offsets, crc


def messages(data: bytes, tables: McapTables | None = None) -> tuple[list[Entry], str | None]:
    """Return the messages in the records of `data` and what is wrong with it (None: nothing).

    Schemas and channels on the way go into `tables`. A record that does not fit ends the walk.
    """
    entries: list[Entry] = []
    pos, end, problem = 0, len(data), None
    while pos + HEAD.size <= end:
        opcode, length = HEAD.unpack_from(data, pos)
        start = pos + HEAD.size
        pos = start + length
        if pos > end:
            return entries, f"{end - start} of {length} bytes of a record"
        if opcode == MESSAGE and length >= MESSAGE_HEAD.size:
            channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, start)
            if log_ns <= MAX_TIME_NS:
                entries.append((log_ns, channel, start + MESSAGE_HEAD.size, pos))
            else:
                problem = "a message with an impossible log time"
        elif opcode in (SCHEMA, CHANNEL) and tables is not None:
            problem = _define(tables, opcode, data[start:pos]) or problem
    return entries, problem if pos == end else f"{end - pos} bytes left over"


def _define(tables: McapTables, opcode: int, content: bytes) -> str | None:
    try:
        tables.define(opcode, content)
    except InputError as error:
        return str(error)
    return None
