"""Messages of a log file in log-time order (in that of the file where its clock was set back), with bounded memory.

MCAP files and bags are sequences of blocks: chunks (compressed or not), or stretches of records outside of any chunk.
A block is loaded as a whole. Blocks that overlap in time are merged with a heap; what the blocks that are open at once
hold is bounded by a budget: beyond it, content that was used longest ago is dropped and loaded again when needed.
"""

from __future__ import annotations

import heapq
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from lhdmap.logs.order import IntArray, clock_was_set_back

BUDGET_BYTES = 96 << 20
MAX_TIME_NS = (1 << 63) - 1
_JITTER_NS = 50_000_000  # by which blocks of a recorder with several threads may overlap

# Log time, channel id, first byte and end of the message in its block.
Entry = tuple[int, int, int, int]


class ChunkBlock(NamedTuple):
    """A stretch of whole records: where its bytes are, its size when decompressed, the log times that it claims."""

    offset: int
    length: int
    size: int
    compression: str
    crc: int
    start_ns: int
    end_ns: int


class Loaded(NamedTuple):
    """The content of a block: its bytes and its messages in the order of the file."""

    data: bytes
    entries: list[Entry]


Load = Callable[[ChunkBlock], Loaded]


def in_time_order(blocks: Sequence[ChunkBlock], load: Load) -> Iterator[tuple[int, int, bytes]]:
    """Yield (log time, channel id, message bytes) in log-time order; equal times in the order of the file."""
    waiting = sorted(blocks, key=lambda block: block.start_ns)
    cache = _Cache(load)
    at = 0
    while at < len(waiting):
        count = _group(waiting, at)
        yield from _one(waiting[at], load) if count == 1 else _merged(waiting[at : at + count], cache)
        at += count


def _group(blocks: Sequence[ChunkBlock], at: int) -> int:
    """Return how many blocks from `at` on overlap in time, each with those before it."""
    end, count = blocks[at].end_ns, 1
    while at + count < len(blocks) and blocks[at + count].start_ns < end:
        end = max(end, blocks[at + count].end_ns)
        count += 1
    return count


def _one(block: ChunkBlock, load: Load) -> Iterator[tuple[int, int, bytes]]:
    data, entries = load(block)
    view = memoryview(data)
    for time_ns, channel, start, end in _sorted(entries):
        yield time_ns, channel, view[start:end]  # type: ignore[misc]


def _merged(blocks: Sequence[ChunkBlock], cache: _Cache) -> Iterator[tuple[int, int, bytes]]:
    """Merge blocks that overlap: each is opened when the time that it claims as its start is reached."""
    heap: list[tuple[int, int, int, Iterator[Entry], Entry]] = []
    opened = 0
    while heap or opened < len(blocks):
        while opened < len(blocks) and (not heap or blocks[opened].start_ns <= heap[0][0]):
            _push(heap, blocks[opened].offset, opened, iter(_sorted(cache.get(blocks[opened]).entries)))
            opened += 1
        if not heap:
            continue
        time_ns, offset, number, rest, entry = heapq.heappop(heap)
        view = memoryview(cache.get(blocks[number]).data)
        yield time_ns, entry[1], view[entry[2] : entry[3]]  # type: ignore[misc]
        _push(heap, offset, number, rest)
    cache.clear()


def _push(
    heap: list[tuple[int, int, int, Iterator[Entry], Entry]], offset: int, number: int, rest: Iterator[Entry]
) -> None:
    entry = next(rest, None)
    if entry is not None:
        heapq.heappush(heap, (entry[0], offset, number, rest, entry))


def _sorted(entries: list[Entry]) -> list[Entry]:
    """Return the entries by time, or as they are where the clock was set back among them.

    The sort is stable and quick where they are in order already.
    """
    ordered = sorted(entries, key=itemgetter(0))
    return entries if ordered != entries and clock_was_set_back(*_times_of(entries)) else ordered


def in_file_order(blocks: Sequence[ChunkBlock], load: Load) -> Iterator[tuple[int, int, bytes]]:
    """Yield (log time, channel id, message bytes) as they stand in the file."""
    for block in blocks:
        data, entries = load(block)
        view = memoryview(data)
        for time_ns, channel, start, end in entries:
            yield time_ns, channel, view[start:end]  # type: ignore[misc]


def set_back(blocks: Sequence[ChunkBlock], load: Load) -> bool:
    """Return whether a clock that was set back explains why blocks, in the order of the file, run back in time.

    They are read through only where they do.
    """
    end_ns, falls = 0, False
    for block in blocks:
        falls |= block.start_ns < end_ns - _JITTER_NS
        end_ns = max(end_ns, block.end_ns)
    if not falls:
        return False
    found = [_times_of(load(block).entries) for block in blocks]
    return clock_was_set_back(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _times_of(entries: list[Entry]) -> tuple[IntArray, IntArray]:
    """Return log times and channels of entries, shape (N,) each."""
    table = np.array([entry[:2] for entry in entries], dtype=np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


class _Cache:
    """The content of the blocks used last, up to `BUDGET_BYTES`."""

    def __init__(self, load: Load) -> None:
        self._load = load
        self._held: OrderedDict[ChunkBlock, Loaded] = OrderedDict()
        self._bytes = 0

    def get(self, block: ChunkBlock) -> Loaded:
        """Return the content of `block`, loading it where it is not held."""
        loaded = self._held.get(block)
        if loaded is None:
            loaded = self._held[block] = self._load(block)
            self._bytes += len(loaded.data)
            self._shrink()
        else:
            self._held.move_to_end(block)
        return loaded

    def clear(self) -> None:
        """Drop all content."""
        self._held.clear()
        self._bytes = 0

    def _shrink(self) -> None:
        while self._bytes > BUDGET_BYTES and len(self._held) > 1:
            _, dropped = self._held.popitem(last=False)
            self._bytes -= len(dropped.data)
