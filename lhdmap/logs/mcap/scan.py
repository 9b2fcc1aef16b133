"""The walk over an MCAP file from record to record, which finds its blocks without believing the index.

After a record with an impossible length it looks for the next place where records fit together, so that damage in the
middle costs what it hit and not all that follows.
"""

from __future__ import annotations

import re
from typing import BinaryIO

from lhdmap.errors import InputError
from lhdmap.logs.blocks import MAX_TIME_NS, ChunkBlock
from lhdmap.logs.findings import Findings
from lhdmap.logs.mcap import records as rec

STRETCH_BYTES = 1 << 20
_LEAST = {
    0x01: 8, 0x02: 20, 0x03: 14, 0x04: 16, 0x05: 22, 0x06: 40, 0x07: 6, 0x08: 68,
    0x09: 36, 0x0A: 44, 0x0B: 46, 0x0C: 8, 0x0D: 20, 0x0E: 17, 0x0F: 4,
}  # fmt: skip
_CANDIDATE = re.compile(rb"[\x03-\x06][\x00-\xff]{4}\x00\x00\x00\x00")
_WINDOW = 1 << 20
_MAX_CANDIDATES = 1 << 20


class McapScan:
    """One walk over the data section: fills `blocks`; what is broken goes to `damage`."""

    def __init__(self, file: BinaryIO, size: int, damage: Findings) -> None:
        self.blocks: list[ChunkBlock] = []
        self._file, self._size, self._damage = file, size, damage
        self._stretch: list[int] | None = None  # start, end, first and last log time of records outside of chunks
        self._candidates = 0

    def run(self) -> None:
        """Walk the whole file."""
        pos: int | None = len(rec.MAGIC)
        while pos is not None:
            pos = self._step(pos)
        self._close_stretch()

    def _step(self, pos: int) -> int | None:
        """Take in the record at `pos` and return where the next one begins, None at the end."""
        head = self._at(pos, rec.HEAD.size)
        if len(head) < rec.HEAD.size:
            self._damage.add(f"cut off at byte {self._size}: the end of the log is missing")
            return None
        opcode, length = rec.HEAD.unpack(head)
        start = pos + rec.HEAD.size
        if length < _LEAST.get(opcode, 0 if opcode >= 0x80 else 1 << 62):
            return self._after_damage(pos, f"no valid record at byte {pos}")
        if start + length > self._size:
            return self._overrun(pos, opcode, length)
        if opcode == rec.CHUNK:
            return self._chunk(pos, length)
        if opcode in (rec.SCHEMA, rec.CHANNEL, rec.MESSAGE):
            self._extend(pos, start + length, opcode)
        else:
            self._close_stretch()
        return None if opcode in (rec.DATA_END, rec.FOOTER) else start + length

    def _chunk(self, pos: int, length: int) -> int | None:
        self._close_stretch()
        start = pos + rec.HEAD.size
        try:
            self.blocks.append(rec.chunk_block(self._at(start, rec.CHUNK_HEAD_MAX), start, length))
        except InputError as error:
            return self._after_damage(pos, f"{error} at byte {pos}")
        return start + length

    def _overrun(self, pos: int, opcode: int, length: int) -> int | None:
        """Take a record that reaches beyond the end of the file: cut off, or its length is wrong."""
        self._close_stretch()
        there = self._size - pos - rec.HEAD.size
        text = f"the record at byte {pos} claims {length} bytes, {there} are there"
        if opcode == rec.CHUNK and self._salvage(pos, length):
            text += "; the messages in that part are used"
        return self._after_damage(pos, text, chunks_only=opcode == rec.CHUNK)

    def _salvage(self, pos: int, length: int) -> bool:
        start = pos + rec.HEAD.size
        try:
            block = rec.chunk_block(self._at(start, rec.CHUNK_HEAD_MAX), start, length)
        except InputError:
            return False
        self.blocks.append(block._replace(length=min(block.length, self._size - block.offset)))
        return True

    def _after_damage(self, pos: int, text: str, *, chunks_only: bool = False) -> int | None:
        """Note the damage and return where records go on, None where they do not."""
        self._close_stretch()
        found = self._resume(pos + 1, chunks_only=chunks_only)
        where = f"; reading goes on at byte {found}" if found else f"; nothing after it (file size {self._size})"
        self._damage.add(text + where)
        return found

    def _resume(self, pos: int, *, chunks_only: bool) -> int | None:
        while pos < self._size and self._candidates < _MAX_CANDIDATES:
            window = self._at(pos, _WINDOW + rec.HEAD.size)
            for match in _CANDIDATE.finditer(window):
                self._candidates += 1
                if chunks_only and window[match.start()] != rec.CHUNK:
                    continue
                if self._plausible(pos + match.start(), depth=3):
                    return pos + match.start()
            pos += _WINDOW
        return None

    def _plausible(self, pos: int, depth: int) -> bool:
        """Return whether `depth` records in a row, from `pos` on, have possible lengths (or the file ends well)."""
        for _ in range(depth):
            head = self._at(pos, rec.HEAD.size)
            if len(head) < rec.HEAD.size:
                return head in (b"", rec.MAGIC)
            opcode, length = rec.HEAD.unpack(head)
            if length < _LEAST.get(opcode, 1 << 62) or pos + rec.HEAD.size + length > self._size:
                return False
            if opcode == rec.CHUNK and not self._is_chunk(pos + rec.HEAD.size, length):
                return False
            pos += rec.HEAD.size + length
        return True

    def _is_chunk(self, start: int, length: int) -> bool:
        try:
            rec.chunk_block(self._at(start, rec.CHUNK_HEAD_MAX), start, length)
        except InputError:
            return False
        return True

    def _extend(self, pos: int, end: int, opcode: int) -> None:
        """Add a record outside of chunks to the stretch that is being gathered."""
        if self._stretch is not None and end - self._stretch[0] > STRETCH_BYTES:
            self._close_stretch()
        if self._stretch is None:
            self._stretch = [pos, end, MAX_TIME_NS, 0]
        self._stretch[1] = end
        if opcode == rec.MESSAGE:
            log_ns = rec.MESSAGE_HEAD.unpack(self._at(pos + rec.HEAD.size, rec.MESSAGE_HEAD.size))[2]
            self._stretch[2], self._stretch[3] = min(self._stretch[2], log_ns), max(self._stretch[3], log_ns)

    def _close_stretch(self) -> None:
        if self._stretch is not None:
            start, end, first_ns, last_ns = self._stretch
            self.blocks.append(ChunkBlock(start, end - start, end - start, "", 0, first_ns, min(last_ns, MAX_TIME_NS)))
        self._stretch = None

    def _at(self, pos: int, size: int) -> bytes:
        self._file.seek(pos)
        return self._file.read(size)
