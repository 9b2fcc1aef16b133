"""ROS 2 bag folders: all `.mcap` and `.db3` files in them as one log, with or without `metadata.yaml`."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator
from operator import itemgetter
from pathlib import Path

from lhdmap.errors import InputError
from lhdmap.logs.base import Channel
from lhdmap.logs.container import Container, Contents, OpenContainer
from lhdmap.logs.findings import Findings
from lhdmap.logs.mcap_log import McapFile
from lhdmap.logs.sqlite_log import SqliteFile

_PARTS: dict[str, OpenContainer] = {".mcap": McapFile, ".db3": SqliteFile}
_SHIFT = 1 << 32


class BagFolder:
    """An open bag folder (a `Container`): channel ids are made unique over its files."""

    def __init__(self, path: Path, damage: Findings) -> None:
        files = sorted(file for file in path.iterdir() if file.suffix in _PARTS and file.is_file())
        if not files:
            raise InputError(f"{path}: no .mcap or .db3 file in this folder; a ROS 2 bag folder was wanted")
        self._parts: list[Container] = []
        problems = []
        for file in files:
            try:
                self._parts.append(_PARTS[file.suffix](file, damage))
            except InputError as error:
                problems.append(str(error))
        if not self._parts:
            raise InputError(problems[0])
        for problem in problems:
            damage.add(problem)
        self.format = f"ROS 2 bag folder ({files[0].suffix[1:]})"

    def contents(self) -> Contents:
        """Return channels, counts and log times of all files together."""
        channels: dict[int, Channel] = {}
        counts: dict[int, int] = {}
        times: list[int] = []
        for number, part in enumerate(self._parts):
            inner = part.contents()
            channels |= {number * _SHIFT + channel: known for channel, known in inner.channels.items()}
            counts |= {number * _SHIFT + channel: count for channel, count in inner.counts.items()}
            times += [time for time in (inner.start_ns, inner.end_ns) if time is not None]
        return Contents(channels, counts, min(times, default=None), max(times, default=None))

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes of all files in log-time order."""
        streams = [self._part_messages(number, wanted) for number in range(len(self._parts))]
        return heapq.merge(*streams, key=itemgetter(0))

    def close(self) -> None:
        """Close all files."""
        for part in self._parts:
            part.close()

    def _part_messages(self, number: int, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        base = number * _SHIFT
        inner = {channel - base for channel in wanted if channel // _SHIFT == number}
        for time_ns, channel, data in self._parts[number].messages(inner):
            yield time_ns, base + channel, data
