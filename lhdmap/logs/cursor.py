"""A position in the bytes of one message: the primitive types of CDR (ROS 2) and of the ROS 1 encoding, length-checked.

CDR: OMG DDS-XTYPES 1.3, section 7.4 (plain CDR, version 1 and 2, either byte order). ROS 1: the same values without
alignment, with a sequence number in each header and no zero at the end of strings.
"""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError

# Representation identifier (second byte of the encapsulation) -> little endian, greatest alignment.
_PLAIN_CDR = {0: (False, 8), 1: (True, 8), 6: (False, 4), 7: (True, 4)}
_MAX_STRING = 1 << 20
_SECOND_NS = 1_000_000_000


class FieldLayout:
    """A run of numbers of one message, all aligned to `align` bytes, in both byte orders."""

    def __init__(self, codes: str, align: int) -> None:
        self.little, self.big = struct.Struct("<" + codes), struct.Struct(">" + codes)
        self.size, self.align = self.little.size, align


UINT8, UINT32, FLOAT64 = FieldLayout("B", 1), FieldLayout("I", 4), FieldLayout("d", 8)
_HEADER_ROS1, _HEADER_ROS2 = FieldLayout("IIII", 4), FieldLayout("iII", 4)  # up to the length of the frame's name


class Cursor:
    """Reads one message from its start; every read beyond the end raises InputError."""

    __slots__ = ("_align", "_data", "_end", "_little", "_pos", "_ros1")

    def __init__(self, data: bytes | memoryview, encoding: str) -> None:
        self._ros1 = encoding == "ros1"
        self._little, self._align = (True, 1) if self._ros1 else _encapsulation(data)
        self._data = memoryview(data) if self._ros1 else memoryview(data)[4:]
        self._pos, self._end = 0, len(self._data)

    def numbers(self, layout: FieldLayout) -> tuple[float, ...]:
        """Return the numbers of `layout`."""
        align = min(self._align, layout.align)
        start = self._pos + -self._pos % align
        self._pos = end = start + layout.size
        if end > self._end:
            raise _too_short(end, self._end)
        return (layout.little if self._little else layout.big).unpack_from(self._data, start)

    def uint32(self) -> int:
        """Return one unsigned number."""
        return int(self.numbers(UINT32)[0])

    def text(self) -> str:
        """Return a string; bytes that are no UTF-8 are replaced."""
        return _decoded(self._raw(self.uint32()))

    def header(self) -> tuple[int, str]:
        """Return stamp (nanoseconds, 0 where not set) and frame (without a leading slash) of a std_msgs/Header."""
        *_, seconds, nanoseconds, size = self.numbers(_HEADER_ROS1 if self._ros1 else _HEADER_ROS2)
        stamp_ns = int(seconds) * _SECOND_NS + int(nanoseconds)
        return max(stamp_ns, 0), _decoded(self._raw(int(size))).lstrip("/")

    def floats32(self) -> npt.NDArray[np.float32]:
        """Return a copy of a sequence of float32."""
        start, end = self._sequence(4)
        # A bytearray: its copy, unlike numpy's, is aligned, writeable and made without giving up the interpreter's lock.
        copied = bytearray(self._data[start:end])
        return np.frombuffer(copied, "<f4") if self._little else np.frombuffer(copied, ">f4").astype(np.float32)

    def skip_floats32(self) -> None:
        """Pass over a sequence of float32: its length must fit."""
        self._sequence(4)

    def floats64(self) -> list[float]:
        """Return a sequence of float64."""
        start, end = self._sequence(8)
        return list(struct.unpack_from(f"{'<' if self._little else '>'}{(end - start) // 8}d", self._data, start))

    def view(self) -> memoryview:
        """Return the bytes of a uint8 sequence without copying them."""
        size = self.uint32()
        start = self._advance(1, size)
        return self._data[start : start + size]

    def texts(self) -> list[str]:
        """Return a sequence of strings."""
        count = self.uint32()
        self._check_count(count, least_bytes=4)
        return [self.text() for _ in range(count)]

    def count(self, least_bytes: int) -> int:
        """Return the length of a sequence whose items take at least `least_bytes` each."""
        count = self.uint32()
        self._check_count(count, least_bytes)
        return count

    def _check_count(self, count: int, least_bytes: int) -> None:
        if count * least_bytes > self._end - self._pos:
            raise InputError(f"a sequence of {count} items in {self._end - self._pos} bytes")

    def _sequence(self, item_bytes: int) -> tuple[int, int]:
        """Pass over a sequence of numbers and return where its first one begins and its last one ends."""
        size = item_bytes * self.uint32()
        start = self._advance(item_bytes if size else 1, size)
        return start, start + size

    def _raw(self, size: int) -> bytes:
        if size > _MAX_STRING:
            raise InputError(f"a string of {size} bytes")
        start = self._advance(1, size)
        return bytes(self._data[start : start + size])

    def _advance(self, align: int, size: int) -> int:
        start = self._pos + -self._pos % min(align, self._align)
        self._pos = end = start + size
        if end > self._end:
            raise _too_short(end, self._end)
        return start


@lru_cache(maxsize=1024)  # names of frames and joints come again in each message
def _decoded(raw: bytes) -> str:
    return raw.rstrip(b"\0").decode("utf-8", "replace")


def _too_short(wanted: int, there: int) -> InputError:
    return InputError(f"{wanted} bytes wanted, {there} there")


def _encapsulation(data: bytes | memoryview) -> tuple[bool, int]:
    if len(data) < 4:
        raise InputError("no CDR header")
    form = _PLAIN_CDR.get(data[1]) if data[0] == 0 else None
    if form is None:
        raise InputError(f"CDR representation {data[0]}.{data[1]} is not plain CDR")
    return form
