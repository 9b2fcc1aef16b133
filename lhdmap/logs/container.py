"""What a file that holds messages offers, whatever its format: channels, and raw messages in log-time order."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple, Protocol

from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import ChunkBlock, Entry, Loaded, in_file_order, in_time_order, set_back
from lhdmap.logs.compression import decompress
from lhdmap.logs.findings import Findings


class Contents(NamedTuple):
    """The table of contents: channels and message counts by channel id, first and last log time (None: no message)."""

    channels: dict[int, Channel]
    counts: dict[int, int]
    start_ns: int | None
    end_ns: int | None


class Container(Protocol):
    """An open file of messages; `remarks`: what is odd but usable in how they are stored."""

    format: str
    remarks: Findings

    def contents(self) -> Contents:
        """Return the table of contents; where the file has none that can be trusted, read through it once."""

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes of the messages of the wanted channels in log-time order."""

    def close(self) -> None:
        """Close the file."""


class BlockFile(ABC):
    """A `Container` that is a sequence of blocks; what opens one sets what it found in the file."""

    _file: BinaryIO
    _blocks: list[ChunkBlock]
    _channels: dict[int, Channel]
    _contents: Contents | None
    _damage: Findings
    _set_back: bool | None = None

    def __init__(self) -> None:
        self.remarks = Findings()

    def contents(self) -> Contents:
        """Return channels, counts and log times, from the index where it is whole."""
        if self._contents is None:
            self._blocks, self._contents = survey(self._blocks, self._load, self._channels)
        return self._contents

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes in log-time order; in that of the file where the clock was set back."""
        self.contents()
        keep = frozenset(wanted)

        def load(block: ChunkBlock) -> Loaded:
            data, entries = self._load(block)
            return Loaded(data, [entry for entry in entries if entry[1] in keep])

        if self._set_back is None:
            self._set_back = set_back(self._blocks, self._load)
        return (in_file_order if self._set_back else in_time_order)(self._blocks, load)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _load(self, block: ChunkBlock) -> Loaded:
        """Return the content of a block; what is wrong with it is noted as damage."""
        self._file.seek(block.offset)
        data, problem = decompress(self._file.read(block.length), block.compression, block.size)
        entries, broken = self._entries(data)
        problem = problem or broken
        if problem is None and block.crc and zlib.crc32(data) != block.crc:
            problem = "its checksum does not fit; its messages are used as they are"
        if problem is not None:
            self._damage.add_once(f"block at byte {block.offset}: {problem}")
        return Loaded(data, entries)

    @abstractmethod
    def _entries(self, data: bytes) -> tuple[list[Entry], str | None]:
        """Return the messages in a block's bytes and what is wrong with them (None: nothing)."""


OpenContainer = Callable[[Path, Findings], Container]


def survey(
    blocks: list[ChunkBlock], load: Callable[[ChunkBlock], Loaded], channels: dict[int, Channel]
) -> tuple[list[ChunkBlock], Contents]:
    """Read through all blocks: return them with their true first and last log time, and the contents.

    `load` fills `channels` on the way. Blocks without a message are left out.
    """
    counts: dict[int, int] = {}
    checked: list[ChunkBlock] = []
    for block in blocks:
        entries = load(block).entries
        for entry in entries:
            counts[entry[1]] = counts.get(entry[1], 0) + 1
        if entries:
            times = [entry[0] for entry in entries]
            checked.append(block._replace(start_ns=min(times), end_ns=max(times)))
    start_ns = min((block.start_ns for block in checked), default=None)
    end_ns = max((block.end_ns for block in checked), default=None)
    return checked, Contents(channels, counts, start_ns, end_ns)
