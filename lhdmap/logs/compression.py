"""Decompression that gives what can be had: of a cut or broken stream, all that comes before the break."""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Callable
from typing import Protocol

import lz4.frame
import zstandard

MAX_BLOCK_BYTES = 256 << 20
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_STEP = 1 << 16
_ZSTD_STEP = 1 << 10  # of which zstd can make 32 MiB


class _Stream(Protocol):
    def decompress(self, data: bytes, /) -> bytes: ...


class _Lz4:
    """An LZ4 frame, at most a step's worth at a time so that a false size allocates nothing."""

    def __init__(self) -> None:
        self._inner = lz4.frame.LZ4FrameDecompressor()

    def decompress(self, data: bytes) -> bytes:
        parts = []
        while not self._inner.eof:
            part = self._inner.decompress(data, max_length=4 * _STEP)
            parts.append(part)
            if self._inner.needs_input or not (part or data):
                break
            data = b""
        return b"".join(parts)


_STREAMS: dict[str, Callable[[], _Stream]] = {
    "zstd": lambda: zstandard.ZstdDecompressor().decompressobj(),
    "lz4": _Lz4,
    "bz2": bz2.BZ2Decompressor,
}
_ERRORS = (zstandard.ZstdError, RuntimeError, OSError, EOFError, ValueError, zlib.error, MemoryError)
COMPRESSIONS = frozenset({"", "none", *_STREAMS})


def decompress(data: bytes, compression: str, size: int) -> tuple[bytes, str | None]:
    """Return the content of a block that claims `size` bytes, and what is wrong with it (None: nothing).

    A stream that breaks off gives what came before the break.
    """
    if compression in ("", "none"):
        return data, None if len(data) == size else f"{len(data)} of {size} bytes"
    if compression not in _STREAMS:
        return b"", f"unknown compression '{compression[:16]}'"
    out, problem = _quick(data, compression, size)
    if problem is not None:
        out, problem = _stepwise(data, compression)
    if problem is None and len(out) != size:
        problem = f"{len(out)} of {size} bytes"
    return out, problem


def inflated(data: bytes) -> bytes:
    """Return the bytes of a message; one that its recorder compressed alone (ROS 2, zstd) is unpacked.

    No message in CDR begins with these bytes, and none of ROS 1 with a sequence number below four billion.
    """
    if data[:4] != ZSTD_MAGIC:
        return data
    data = bytes(data)
    try:
        size = zstandard.frame_content_size(data)
    except zstandard.ZstdError:
        size = -1
    return decompress(data, "zstd", size if size >= 0 else MAX_BLOCK_BYTES + 1)[0]


def _quick(data: bytes, compression: str, size: int) -> tuple[bytes, str | None]:
    """Decompress in one call where the claimed size is a sane one."""
    if size > MAX_BLOCK_BYTES or compression != "zstd":
        return b"", "try step by step"
    try:
        if zstandard.frame_content_size(data) > MAX_BLOCK_BYTES:
            return b"", "a false size"
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(size, 1)), None
    except _ERRORS as error:
        return b"", str(error)


def _stepwise(data: bytes, compression: str) -> tuple[bytes, str | None]:
    """Decompress in small steps; on an error what came before it is kept."""
    stream = _STREAMS[compression]()
    parts: list[bytes] = []
    total = 0
    step = _ZSTD_STEP if compression == "zstd" else _STEP
    for start in range(0, len(data), step):
        problem = _feed(stream, data[start : start + step], parts)
        if problem is not None:
            return b"".join(parts), problem
        total += len(parts[-1])
        if total > MAX_BLOCK_BYTES:
            return b"".join(parts)[:MAX_BLOCK_BYTES], f"more than {MAX_BLOCK_BYTES >> 20} MiB in one block"
    return b"".join(parts), None


def _feed(stream: _Stream, step: bytes, parts: list[bytes]) -> str | None:
    try:
        parts.append(stream.decompress(step))
    except _ERRORS as error:
        return str(error) or type(error).__name__
    return None
