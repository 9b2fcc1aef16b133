"""What a file that holds messages offers, whatever its format: channels, and raw messages in log-time order."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

from lhdmap.logs.base import Channel
from lhdmap.logs.blocks import Block, Loaded
from lhdmap.logs.findings import Findings


class Contents(NamedTuple):
    """The table of contents: channels and message counts by channel id, first and last log time (None: no message)."""

    channels: dict[int, Channel]
    counts: dict[int, int]
    start_ns: int | None
    end_ns: int | None


class Container(Protocol):
    """An open file of messages."""

    format: str

    def contents(self) -> Contents:
        """Return the table of contents; where the file has none that can be trusted, read through it once."""

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes of the messages of the wanted channels in log-time order."""

    def close(self) -> None:
        """Close the file."""


OpenContainer = Callable[[Path, Findings], Container]


def survey(
    blocks: list[Block], load: Callable[[Block], Loaded], channels: dict[int, Channel]
) -> tuple[list[Block], Contents]:
    """Read through all blocks: return them with their true first and last log time, and the contents.

    `load` fills `channels` on the way. Blocks without a message are left out.
    """
    counts: dict[int, int] = {}
    checked: list[Block] = []
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
