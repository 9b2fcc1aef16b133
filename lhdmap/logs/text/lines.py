"""Lines of a text log, plain or compressed (gzip, bzip2, by the first bytes), in constant memory."""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from lhdmap.logs.findings import Findings

MAX_LINE_BYTES = 1 << 20
_STEP = 1 << 16
_GZIP_WINDOW = 31  # zlib: expect a gzip header


class _Stream(Protocol):
    @property
    def eof(self) -> bool: ...
    @property
    def unused_data(self) -> bytes: ...
    @property
    def needs_input(self) -> bool: ...
    def decompress(self, data: bytes, max_length: int = ...) -> bytes: ...


class _Gzip:
    """One gzip member with the interface of `bz2.BZ2Decompressor`."""

    def __init__(self) -> None:
        self._inner = zlib.decompressobj(_GZIP_WINDOW)

    @property
    def eof(self) -> bool:
        return self._inner.eof

    @property
    def unused_data(self) -> bytes:
        return self._inner.unused_data

    @property
    def needs_input(self) -> bool:
        return not self._inner.unconsumed_tail

    def decompress(self, data: bytes, max_length: int = -1) -> bytes:
        return self._inner.decompress(self._inner.unconsumed_tail + data, max(max_length, 0))


def text_lines(path: Path, damage: Findings) -> Iterator[bytes]:
    """Yield the lines, without their ends; the last one may lack its end. Overlong lines are skipped and noted."""
    rest = b""
    for part in _decompressed(path, damage):
        *whole, rest = (rest + part).split(b"\n")
        yield from whole
        if len(rest) > MAX_LINE_BYTES:
            damage.add(f"a line of more than {MAX_LINE_BYTES} bytes was skipped: is this a text log?")
            rest = b""
    if rest:
        yield rest


def _decompressed(path: Path, damage: Findings) -> Iterator[bytes]:
    with path.open("rb") as file:
        kind = file.read(3)
        file.seek(0)
        parts = iter(lambda: file.read(_STEP), b"")
        if kind == b"BZh":
            yield from _streamed(parts, bz2.BZ2Decompressor, damage)
        elif kind[:2] == b"\x1f\x8b":
            yield from _streamed(parts, _Gzip, damage)
        else:
            yield from parts


def _streamed(parts: Iterator[bytes], kind: type[_Stream], damage: Findings) -> Iterator[bytes]:
    """Decompress streams that follow each other; what comes before a break is yielded, the break noted."""
    stream: _Stream = kind()
    data = b""
    try:
        while True:
            if not data and (stream.eof or stream.needs_input):
                data = next(parts, b"")
                if not data:
                    break
            if stream.eof:
                stream = kind()
            yield stream.decompress(data, _STEP)
            data = stream.unused_data if stream.eof else b""
    except (OSError, EOFError, ValueError, zlib.error) as error:
        damage.add(f"the compressed file is damaged ({error}): reading ends there")
        return
    if not stream.eof:
        damage.add("the compressed file is cut off: reading ends there")
