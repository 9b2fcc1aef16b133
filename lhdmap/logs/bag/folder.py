"""ROS 2 bag folders: their `.mcap` and `.db3` files, compressed or not, as one log, with or without `metadata.yaml`."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Collection, Iterator
from operator import itemgetter
from pathlib import Path

from lhdmap.errors import InputError
from lhdmap.logs.bag.metadata import NAME, bare, files_of, storage
from lhdmap.logs.base import Channel
from lhdmap.logs.container import Container, Contents, OpenContainer
from lhdmap.logs.findings import Findings
from lhdmap.logs.mcap.log import McapFile
from lhdmap.logs.order import pieces_fit
from lhdmap.logs.packed import PackedFile
from lhdmap.logs.sqlite.log import SqliteFile

_PARTS: dict[str, OpenContainer] = {".mcap": McapFile, ".db3": SqliteFile}
_SHIFT = 1 << 32
_FEW = 3  # messages of a topic that each file begins with, such as transforms


class BagFolder:
    """An open bag folder (a `Container`): channel ids are made unique over its files."""

    def __init__(self, path: Path, damage: Findings) -> None:
        self.remarks = Findings()
        files, missing = files_of(path, self.remarks)
        self._parts: list[Container] = []
        problems: list[str] = []
        try:
            for file in files:
                self._open(file, damage, problems)
        except BaseException:
            self.close()
            raise
        if not self._parts:
            raise InputError(problems[0])
        for name in missing:
            damage.add(f"{name} is named in {NAME} and is not there: its messages are missing")
        for problem in problems:
            damage.add(problem)
        packed = ", compressed" if any(bare(file.name) != file.name for file in files) else ""
        self.format = f"ROS 2 bag folder ({storage(files[0].name)[1:]}{packed})"

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
        """Yield log time, channel id and bytes of all files in log-time order; one file after the other where a clock was set."""
        streams = [self._part_messages(number, wanted) for number in range(len(self._parts))]
        return itertools.chain(*streams) if self._set_back() else heapq.merge(*streams, key=itemgetter(0))

    def _set_back(self) -> bool:
        """Return whether files that go on with each other's topics run back in time, and do not just stand in another order."""
        parts = [part.contents() for part in self._parts]
        times = [(one.start_ns, one.end_ns) for one in parts if one.start_ns is not None and one.end_ns is not None]
        topics = [{one.channels[n].topic for n, count in one.counts.items() if count > _FEW} for one in parts]
        follow = any(before & after for before, after in itertools.pairwise(topics))
        falls = any(after[0] < before[1] for before, after in itertools.pairwise(times))
        return follow and falls and not pieces_fit(times)

    def close(self) -> None:
        """Close all files."""
        for part in self._parts:
            part.close()

    def _open(self, file: Path, damage: Findings, problems: list[str]) -> None:
        """Open one file; what is wrong with it is noted with its name."""
        container = _PARTS[storage(file.name)] if bare(file.name) == file.name else PackedFile
        try:
            self._parts.append(container(file, damage.part(file.name)))
        except InputError as error:
            problems.append(str(error))

    def _part_messages(self, number: int, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        base = number * _SHIFT
        inner = {channel - base for channel in wanted if channel // _SHIFT == number}
        for time_ns, channel, data in self._parts[number].messages(inner):
            yield time_ns, base + channel, data
