"""A position in the bytes of one message: the primitive types of CDR (ROS 2) and of the ROS 1 encoding, length-checked.

CDR: OMG DDS-XTYPES 1.3, section 7.4 (plain CDR, version 1 and 2, either byte order). ROS 1: the same values without
alignment, with a sequence number in each header and no zero at the end of strings.
"""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError

# Representation identifier (second byte of the encapsulation) -> byte order, greatest alignment.
_PLAIN_CDR = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
_MAX_STRING = 1 << 20
_SECOND_NS = 1_000_000_000


class Layout:
    """A run of numbers of one message, all aligned to `align` bytes, in both byte orders."""

    def __init__(self, codes: str, align: int) -> None:
        self.little, self.big = struct.Struct("<" + codes), struct.Struct(">" + codes)
        self.size, self.align = self.little.size, align


UINT8, UINT32, FLOAT64 = Layout("B", 1), Layout("I", 4), Layout("d", 8)
_STAMP_ROS1, _STAMP_ROS2 = Layout("III", 4), Layout("iI", 4)


class Cursor:
    """Reads one message from its start; every read beyond the end raises InputError."""

    __slots__ = ("_align", "_data", "_end", "_order", "_pos", "_ros1")

    def __init__(self, data: bytes | memoryview, encoding: str) -> None:
        self._ros1 = encoding == "ros1"
        self._order, self._align = ("<", 1) if self._ros1 else _encapsulation(data)
        self._data = memoryview(data) if self._ros1 else memoryview(data)[4:]
        self._pos, self._end = 0, len(self._data)

    def numbers(self, layout: Layout) -> tuple[float, ...]:
        """Return the numbers of `layout`."""
        start = self._advance(layout.align, layout.size)
        return (layout.little if self._order == "<" else layout.big).unpack_from(self._data, start)

    def uint32(self) -> int:
        """Return one unsigned number."""
        return int(self.numbers(UINT32)[0])

    def text(self) -> str:
        """Return a string; bytes that are no UTF-8 are replaced."""
        size = self.uint32()
        if size > _MAX_STRING:
            raise InputError(f"a string of {size} bytes")
        start = self._advance(1, size)
        return bytes(self._data[start : start + size]).rstrip(b"\0").decode("utf-8", "replace")

    def header(self) -> tuple[int, str]:
        """Return stamp (nanoseconds, 0 where not set) and frame (without a leading slash) of a std_msgs/Header."""
        if self._ros1:
            _, seconds, nanoseconds = self.numbers(_STAMP_ROS1)
        else:
            seconds, nanoseconds = self.numbers(_STAMP_ROS2)
        return max(int(seconds) * _SECOND_NS + int(nanoseconds), 0), self.text().lstrip("/")

    def floats32(self) -> npt.NDArray[np.float32]:
        """Return a copy of a sequence of float32."""
        count = self.uint32()
        if not count:
            return np.empty(0, np.float32)
        start = self._advance(4, 4 * count)
        return np.frombuffer(self._data, self._order + "f4", count, start).astype(np.float32)

    def floats64(self) -> list[float]:
        """Return a sequence of float64."""
        count = self.uint32()
        if not count:
            return []
        start = self._advance(8, 8 * count)
        return np.frombuffer(self._data, self._order + "f8", count, start).tolist()

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

    def _advance(self, align: int, size: int) -> int:
        start = self._pos + -self._pos % min(align, self._align)
        if start + size > self._end:
            raise InputError(f"{start + size} bytes wanted, {self._end} there")
        self._pos = start + size
        return start


def _encapsulation(data: bytes | memoryview) -> tuple[str, int]:
    if len(data) < 4:
        raise InputError("no CDR header")
    form = _PLAIN_CDR.get(data[1]) if data[0] == 0 else None
    if form is None:
        raise InputError(f"CDR representation {data[0]}.{data[1]} is not plain CDR")
    return form
