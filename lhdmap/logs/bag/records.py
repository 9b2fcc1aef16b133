"""Records of a ROS 1 bag, version 2.0: bytes to fields, each length checked before it is believed.

A record is a header (its length, then fields `name=value`, each with its length) and data with its length (4 bytes,
little endian). Source: wiki.ros.org/Bags/Format/2.0.
"""

from __future__ import annotations

import struct

from lhdmap.errors import InputError
from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import Entry
from lhdmap.logs.mcap.records import ros2_type

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
OPS = frozenset({MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION})
MAX_HEADER_BYTES = 1 << 16
U32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_PAIR = struct.Struct("<II")
# The header of a message as the usual writers lay it out: conn (4 bytes), op (1), time (8), each field with its length.
_USUAL = struct.Struct("<5x4xI7xB5x4xII")
_SECOND_NS = 1_000_000_000

Fields = dict[bytes, bytes]


def fields_of(header: bytes | memoryview) -> Fields:
    """Return the fields of a record header; raises InputError where it is none."""
    found: Fields = {}
    pos, raw = 0, bytes(header)
    while pos < len(raw):
        if pos + 4 > len(raw):
            raise InputError("a record header that is broken")
        (size,) = U32.unpack_from(raw, pos)
        name, equals, value = raw[pos + 4 : pos + 4 + size].partition(b"=")
        if not equals or pos + 4 + size > len(raw):
            raise InputError("a record header that is broken")
        found[name] = value
        pos += 4 + size
    return found


def op_of(fields: Fields) -> int:
    """Return the kind of a record, -1 where the header does not say."""
    op = fields.get(b"op", b"")
    return op[0] if len(op) == 1 else -1


def number(fields: Fields, name: bytes) -> int:
    """Return a 4-byte field; raises InputError where it is absent."""
    value = fields.get(name, b"")
    if len(value) != 4:
        raise InputError(f"a record without its field '{name.decode()}'")
    return int.from_bytes(value, "little")


def time_ns(fields: Fields, name: bytes) -> int:
    """Return a time field in nanoseconds; raises InputError where it is absent."""
    value = fields.get(name, b"")
    if len(value) != 8:
        raise InputError(f"a record without its field '{name.decode()}'")
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds) * _SECOND_NS + int(nanoseconds)


def connection(fields: Fields, data: bytes) -> tuple[int, Channel]:
    """Return id and channel of a connection record; raises InputError where it is broken."""
    inner = fields_of(data)
    topic = fields.get(b"topic") or inner.get(b"topic", b"")
    kind = inner.get(b"type", b"unknown").decode("utf-8", "replace")
    return number(fields, b"conn"), Channel(topic.decode("utf-8", "replace"), ros2_type(kind), "ros1")


def chunk_counts(data: bytes) -> dict[int, int]:
    """Return the message counts by connection of a chunk info record."""
    usable = len(data) - len(data) % _PAIR.size
    return {int(conn): int(count) for conn, count in _PAIR.iter_unpack(data[:usable])}


def messages(data: bytes, channels: dict[int, Channel]) -> tuple[list[Entry], str | None]:
    """Return the messages in the records of `data` and what is wrong with it (None: nothing).

    Connections on the way go into `channels`. A record that does not fit ends the walk.
    """
    entries: list[Entry] = []
    pos, end = 0, len(data)
    problem = None
    while pos + 8 <= end:
        head = pos + 4
        body = head + U32.unpack_from(data, pos)[0]
        if body + 4 > end:
            return entries, f"{end - pos} bytes of a longer record"
        start = body + 4
        pos = start + U32.unpack_from(data, body)[0]
        if pos > end:
            return entries, f"{end - start} of {pos - start} bytes of a record"
        try:
            _take(data, (head, body, start, pos), entries, channels)
        except InputError as error:
            problem = str(error)
    return entries, problem if pos == end else f"{end - pos} bytes left over"


def _take(data: bytes, bounds: tuple[int, int, int, int], entries: list[Entry], channels: dict[int, Channel]) -> None:
    """Take in one record whose header, and data, are between these bounds."""
    head, body, start, end = bounds
    if body - head == 38 and data[head + 4 : head + 9] == b"conn=" and data[head + 25 : head + 30] == b"time=":
        conn, op, seconds, nanoseconds = _USUAL.unpack_from(data, head + 4)
        if op == MESSAGE:
            entries.append((seconds * _SECOND_NS + nanoseconds, conn, start, end))
            return
    fields = fields_of(data[head:body])
    op = op_of(fields)
    if op == MESSAGE:
        entries.append((time_ns(fields, b"time"), number(fields, b"conn"), start, end))
    elif op == CONNECTION:
        number_, channel = connection(fields, data[start:end])
        channels.setdefault(number_, channel)
