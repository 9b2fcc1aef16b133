"""Rows of a damaged SQLite file, page by page, without its trees: what a cut-off `.db3` still holds.

Every message whose leaf page and overflow pages are there is found, also where the pages that lead to it are not.
Source: sqlite.org/fileformat2.html, sections 1.5 and 1.6, 2.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from lhdmap.errors import InputError

Value = int | bytes | None

_LEAF = 0x0D
_HEADER_BYTES = 100
_INTEGER_SIZES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
_MAX_COLUMNS = 16


class PageRow(NamedTuple):
    """One row: its rowid and its columns (None, integers, or the bytes of texts and blobs)."""

    rowid: int
    columns: list[Value]


class PagePlace(NamedTuple):
    """Where a row is: page number (from 0) and offset of its cell in the page."""

    page: int
    offset: int


class Pages:
    """The pages of a database file."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        file.seek(0)
        header = file.read(_HEADER_BYTES)
        stated = int.from_bytes(header[16:18], "big")
        self.page_bytes = 65536 if stated == 1 else stated
        if not 512 <= self.page_bytes <= 65536 or self.page_bytes & (self.page_bytes - 1):
            self.page_bytes = 4096
        self._usable = self.page_bytes - (header[20] if len(header) > 20 else 0)
        self._size = size
        if self._usable < 480:
            self._usable = self.page_bytes

    def rows(self) -> Iterator[tuple[PagePlace, PageRow]]:
        """Yield all rows that can be read, in the order of the pages."""
        for number in range(self._size // self.page_bytes):
            page = self._page(number)
            for offset in _cells(page, _HEADER_BYTES if number == 0 else 0):
                try:
                    yield PagePlace(number, offset), self._row(page, offset)
                except (InputError, IndexError):
                    continue

    def row(self, place: PagePlace) -> PageRow:
        """Return the row at a place that `rows` gave."""
        return self._row(self._page(place.page), place.offset)

    def _page(self, number: int) -> bytes:
        self._file.seek(number * self.page_bytes)
        return self._file.read(self.page_bytes)

    def _row(self, page: bytes, offset: int) -> PageRow:
        payload_bytes, pos = _varint(page, offset)
        rowid, pos = _varint(page, pos)
        return PageRow(rowid, _columns(self._payload(page, pos, payload_bytes)))

    def _payload(self, page: bytes, pos: int, size: int) -> bytes:
        """Return the payload of a cell, the part on overflow pages included."""
        if size > self._size:
            raise InputError("a row that is larger than the file")
        local = self._local(size)
        if pos + local + (4 if local < size else 0) > len(page):
            raise InputError("a row that does not fit its page")
        parts, missing = [page[pos : pos + local]], size - local
        following = int.from_bytes(page[pos + local : pos + local + 4], "big") if missing else 0
        while missing:
            part = self._page(following - 1) if following > 0 else b""
            if len(part) < self.page_bytes:
                raise InputError("a row whose overflow page is missing")
            parts.append(part[4 : min(4 + missing, self._usable)])
            missing -= len(parts[-1])
            following = int.from_bytes(part[:4], "big")
        return b"".join(parts)

    def _local(self, size: int) -> int:
        """Return how many bytes of a payload are in its leaf page."""
        usable = self._usable
        if size <= usable - 35:
            return size
        least = (usable - 12) * 32 // 255 - 23
        local = least + (size - least) % (usable - 4)
        return local if local <= usable - 35 else least


def _cells(page: bytes, start: int) -> list[int]:
    """Return the offsets of the cells of a leaf page of a table, none for another page."""
    if len(page) <= start + 8 or page[start] != _LEAF:
        return []
    count = int.from_bytes(page[start + 3 : start + 5], "big")
    table = page[start + 8 : start + 8 + 2 * count]
    return [int.from_bytes(table[i : i + 2], "big") for i in range(0, len(table) - 1, 2)]


def _varint(data: bytes, pos: int) -> tuple[int, int]:
    """Return a variable-length integer and where it ends; IndexError beyond the data."""
    value = 0
    for count in range(9):
        byte = data[pos + count]
        if count == 8:
            return (value << 8) | byte, pos + 9
        value = (value << 7) | (byte & 0x7F)
        if byte < 0x80:
            return value, pos + count + 1
    raise InputError("no integer")


def _columns(payload: bytes) -> list[Value]:
    head_bytes, pos = _varint(payload, 0)
    at = head_bytes
    columns: list[Value] = []
    while pos < head_bytes:
        if len(columns) >= _MAX_COLUMNS:
            raise InputError("too many columns")
        kind, pos = _varint(payload, pos)
        value, at = _column(payload, kind, at)
        columns.append(value)
    return columns


def _column(payload: bytes, kind: int, at: int) -> tuple[Value, int]:
    if kind in (0, 7, 8, 9, 10, 11):
        if kind == 7:
            return None, at + 8
        return {8: 0, 9: 1}.get(kind), at
    size = _INTEGER_SIZES[kind] if kind in _INTEGER_SIZES else (kind - 12) // 2
    if at + size > len(payload):
        raise InputError("a column that is too long")
    raw = payload[at : at + size]
    return int.from_bytes(raw, "big", signed=True) if kind in _INTEGER_SIZES else raw, at + size
