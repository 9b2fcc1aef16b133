"""The walk over a ROS 1 bag from record to record, which finds its chunks without believing the index."""

from __future__ import annotations

import re
from typing import BinaryIO, NamedTuple

from lhdmap.errors import InputError
from lhdmap.logs.bag import records as rec
from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import MAX_TIME_NS, ChunkBlock
from lhdmap.logs.findings import Findings

_STRETCH_BYTES = 1 << 20
_OP_FIELD = re.compile(rb"\x04\x00\x00\x00op=[\x02-\x07]")
_WINDOW = 1 << 20
_INDEX_ENTRY_BYTES = 12


class BagRecord(NamedTuple):
    """One record at the top level: its fields, where its data begins, and how long that claims to be."""

    fields: rec.Fields
    start: int
    length: int

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.start + self.length


class ChunkInfo(NamedTuple):
    """What the index says of one chunk."""

    start_ns: int
    end_ns: int
    counts: dict[int, int]


class BagScan:
    """One walk over the file: fills `blocks` (and at which byte the record of each begins), `infos` and `channels`."""

    def __init__(self, file: BinaryIO, size: int, damage: Findings) -> None:
        self.blocks: list[ChunkBlock] = []
        self.positions: list[int] = []
        self.infos: dict[int, ChunkInfo] = {}
        self.channels: dict[int, Channel] = {}
        self._file, self._size, self._damage = file, size, damage

    def run(self) -> None:
        """Walk the whole file."""
        pos: int | None = len(rec.MAGIC)
        while pos is not None and pos < self._size:
            record = self._record(pos)
            if record is None:
                pos = self._after_damage(pos, f"no valid record at byte {pos}")
            elif record.end > self._size:
                pos = self._overrun(pos, record)
            else:
                pos = self._take(pos, record)

    def _record(self, pos: int) -> BagRecord | None:
        """Return the record at `pos`, None where there is none."""
        size_field = self._at(pos, 4)
        if len(size_field) < 4:
            return None
        (header_size,) = rec.U32.unpack(size_field)
        if header_size > rec.MAX_HEADER_BYTES:
            return None
        raw = self._at(pos + 4, header_size + 4)
        if len(raw) < header_size + 4:
            return None
        try:
            fields = rec.fields_of(raw[:header_size])
        except InputError:
            return None
        if rec.op_of(fields) not in rec.OPS:
            return None
        return BagRecord(fields, pos + 8 + header_size, rec.U32.unpack(raw[header_size:])[0])

    def _take(self, pos: int, record: BagRecord) -> int:
        op = rec.op_of(record.fields)
        try:
            if op == rec.CHUNK:
                self._add(pos, self._chunk(record))
            elif op == rec.MESSAGE:
                self._add(pos, _stretch(pos, record.end))
            elif op == rec.CONNECTION:
                number, channel = rec.connection(record.fields, self._at(record.start, record.length))
                self.channels.setdefault(number, channel)
            elif op == rec.CHUNK_INFO:
                self._chunk_info(record)
        except InputError as error:
            self._damage.add(f"{error} at byte {pos}")
        return self._index_end(record) if op == rec.INDEX else record.end

    def _add(self, pos: int, block: ChunkBlock) -> None:
        """Add a block; messages outside of chunks that follow each other become one."""
        if block.compression == "" and self.blocks and self._follows(self.blocks[-1], block):
            joined = self.blocks[-1].length + block.length
            self.blocks[-1] = self.blocks[-1]._replace(length=joined, size=joined)
            return
        self.blocks.append(block)
        self.positions.append(pos)

    @staticmethod
    def _follows(before: ChunkBlock, block: ChunkBlock) -> bool:
        near = before.offset + before.length == block.offset
        return near and before.compression == "" and before.length < _STRETCH_BYTES

    def _chunk(self, record: BagRecord) -> ChunkBlock:
        compression = record.fields.get(b"compression", b"").decode("ascii", "replace") or "none"
        length = min(record.length, self._size - record.start)
        return ChunkBlock(record.start, length, rec.number(record.fields, b"size"), compression, 0, 0, MAX_TIME_NS)

    def _chunk_info(self, record: BagRecord) -> None:
        position = int.from_bytes(record.fields.get(b"chunk_pos", b""), "little")
        counts = rec.chunk_counts(self._at(record.start, record.length))
        start_ns, end_ns = rec.time_ns(record.fields, b"start_time"), rec.time_ns(record.fields, b"end_time")
        self.infos[position] = ChunkInfo(start_ns, end_ns, counts)

    def _index_end(self, record: BagRecord) -> int:
        """Return where an index record really ends: some writers state a wrong length, the count is right then."""
        counted = record.start + _INDEX_ENTRY_BYTES * int.from_bytes(record.fields.get(b"count", b""), "little")
        if counted == record.end or self._is_start(record.end) or not self._is_start(counted):
            return record.end
        self._damage.add("an index record states a wrong length; the index is not used")
        return counted

    def _is_start(self, pos: int) -> bool:
        return pos == self._size or self._record(pos) is not None

    def _overrun(self, pos: int, record: BagRecord) -> int | None:
        """Take a record that reaches beyond the end of the file: cut off, or its length is wrong."""
        op = rec.op_of(record.fields)
        if op == rec.INDEX:
            counted = self._index_end(record)
            if counted < self._size:
                return counted
        text = f"the record at byte {pos} claims {record.length} bytes, {self._size - record.start} are there"
        if op == rec.CHUNK:
            try:
                self._add(pos, self._chunk(record))
                text += "; the messages in that part are used"
            except InputError as error:
                text += f"; {error}"
        return self._after_damage(pos, text)

    def _after_damage(self, pos: int, text: str) -> int | None:
        found = self._resume(pos + 1)
        where = f"; reading goes on at byte {found}" if found else f"; nothing after it (file size {self._size})"
        self._damage.add(text + where)
        return found

    def _resume(self, pos: int) -> int | None:
        """Return where the next chunk or connection at the top level begins, None where there is none."""
        start = pos
        while pos < self._size:
            window = self._at(pos, _WINDOW + 8)
            for match in _OP_FIELD.finditer(window):
                found = self._start_before(start, pos + match.start(), match.group()[-1])
                if found is not None:
                    return found
            pos += _WINDOW
        return None

    def _start_before(self, least: int, field: int, op: int) -> int | None:
        """Return the begin of a chunk record that has its op field at `field`."""
        if op != rec.CHUNK:
            return None
        for pos in range(field - 4, max(field - 128, least - 1), -1):
            record = self._record(pos)
            if record is not None and record.start > field and rec.op_of(record.fields) == op:
                return pos
        return None

    def _at(self, pos: int, size: int) -> bytes:
        self._file.seek(pos)
        return self._file.read(size)


def _stretch(start: int, end: int) -> ChunkBlock:
    return ChunkBlock(start, end - start, end - start, "", 0, 0, MAX_TIME_NS)
