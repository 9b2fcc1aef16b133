"""MCAP files: chunked or not, zstd, lz4 or uncompressed, whole, cut off anywhere, or damaged in the middle."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from lhdmap.errors import InputError
from lhdmap.logs.blocks import Entry
from lhdmap.logs.compression import inflated
from lhdmap.logs.container import BlockFile, Contents
from lhdmap.logs.findings import Findings
from lhdmap.logs.mcap import records as rec
from lhdmap.logs.mcap.scan import McapScan

_FOOTER_BYTES = rec.HEAD.size + 20
_MAX_SUMMARY_BYTES = 256 << 20


class McapFile(BlockFile):
    """An open MCAP file (a `Container`)."""

    format = "mcap"

    def __init__(self, path: Path, damage: Findings) -> None:
        super().__init__()
        self._damage = damage
        self._file: BinaryIO = path.open("rb", buffering=1 << 16)
        self._size = path.stat().st_size
        if self._file.read(len(rec.MAGIC)) != rec.MAGIC:
            self._file.close()
            raise InputError(
                f"{path}: not an MCAP file (its first bytes are not MCAP's); is it another format, or empty?"
            )
        self._tables = rec.McapTables()
        self._channels = self._tables.channels
        scan = McapScan(self._file, self._size, damage)
        scan.run()
        self._blocks = scan.blocks
        self._contents = self._summary()

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes in log-time order; messages compressed one by one are unpacked."""
        for time_ns, channel, data in super().messages(wanted):
            yield time_ns, channel, inflated(data)

    def _entries(self, data: bytes) -> tuple[list[Entry], str | None]:
        return rec.messages(data, self._tables)

    def _summary(self) -> Contents | None:
        """Return the contents that the summary section states, None where it is absent or broken."""
        if len(self._damage):
            return None
        try:
            return self._read_summary()
        except InputError as error:
            self._damage.add(f"the summary section is not usable ({error}); the log is read through instead")
            return None

    def _read_summary(self) -> Contents | None:
        tail_start = max(self._size - _FOOTER_BYTES - len(rec.MAGIC), 0)
        self._file.seek(tail_start)
        tail = self._file.read()
        opcode, length = rec.HEAD.unpack_from(tail) if len(tail) >= rec.HEAD.size else (0, 0)
        if opcode != rec.FOOTER or length != 20 or not tail.endswith(rec.MAGIC):
            raise InputError("cut off: the end of the file is not an MCAP file's")
        start, _, crc = rec.footer(tail[rec.HEAD.size : rec.HEAD.size + 20])
        if start == 0:
            return None
        if not 0 < tail_start - start < _MAX_SUMMARY_BYTES:
            raise InputError("its position is impossible")
        self._file.seek(start)
        summary = self._file.read(tail_start - start)
        if crc and zlib.crc32(summary + tail[: _FOOTER_BYTES - 4]) != crc:
            raise InputError("its checksum does not fit")
        return _stated(summary, self._tables)


def _stated(summary: bytes, tables: rec.McapTables) -> Contents | None:
    """Return the contents from the records of a summary section, None where it has no statistics."""
    found, pos = None, 0
    while pos + rec.HEAD.size <= len(summary):
        opcode, length = rec.HEAD.unpack_from(summary, pos)
        pos += rec.HEAD.size
        content = summary[pos : pos + length]
        if opcode in (rec.SCHEMA, rec.CHANNEL):
            tables.define(opcode, content)
        elif opcode == rec.STATISTICS:
            found = rec.statistics(content)
        pos += length
    if found is None or not found.counts.keys() <= tables.channels.keys():
        return None
    any_message = any(found.counts.values())
    times = (found.start_ns, found.end_ns) if any_message else (None, None)
    return Contents(tables.channels, dict(found.counts), *times)
