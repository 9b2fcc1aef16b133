"""ROS 1 bags, version 2.0: chunks uncompressed, bz2 or lz4; indexed, not indexed, with a wrong index, or cut off."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from lhdmap.errors import InputError
from lhdmap.logs import bag_records as rec
from lhdmap.logs.bag_scan import Scan
from lhdmap.logs.blocks import Block, Loaded, in_time_order
from lhdmap.logs.compression import decompress
from lhdmap.logs.container import Contents, survey
from lhdmap.logs.findings import Findings


class BagFile:
    """An open bag (a `Container`)."""

    format = "ROS 1 bag"

    def __init__(self, path: Path, damage: Findings) -> None:
        self._damage = damage
        self._file: BinaryIO = path.open("rb", buffering=1 << 16)
        start = self._file.read(len(rec.MAGIC))
        if start != rec.MAGIC:
            self._file.close()
            found = start.decode("ascii", "replace").strip() if start.startswith(b"#ROSBAG") else "other bytes"
            raise InputError(f"{path}: it begins with {found}, '#ROSBAG V2.0' was wanted; is it another format?")
        scan = Scan(self._file, path.stat().st_size, damage)
        scan.run()
        self._channels = scan.channels
        self._blocks = scan.blocks
        self._contents = self._indexed(scan)

    def contents(self) -> Contents:
        """Return channels, counts and log times, from the index where it is whole."""
        if self._contents is None:
            self._blocks, self._contents = survey(self._blocks, self._load, self._channels)
        return self._contents

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, connection id and bytes in log-time order."""
        self.contents()
        keep = frozenset(wanted)

        def load(block: Block) -> Loaded:
            data, entries = self._load(block)
            return Loaded(data, [entry for entry in entries if entry[1] in keep])

        return in_time_order(self._blocks, load)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _load(self, block: Block) -> Loaded:
        self._file.seek(block.offset)
        data, problem = decompress(self._file.read(block.length), block.compression, block.size)
        entries, broken = rec.messages(data, self._channels)
        problem = problem or broken
        if problem is not None:
            self._damage.add_once(f"block at byte {block.offset}: {problem}")
        return Loaded(data, entries)

    def _indexed(self, scan: Scan) -> Contents | None:
        """Return the contents that the index states, None where it does not cover all chunks."""
        infos = [scan.infos.get(position) for position in scan.positions]
        known = [info for info in infos if info is not None]
        if len(self._damage) or len(known) != len(infos):
            return None
        pairs = zip(self._blocks, known, strict=True)
        self._blocks = [block._replace(start_ns=info.start_ns, end_ns=info.end_ns) for block, info in pairs]
        counts: dict[int, int] = {}
        for info in known:
            for connection, count in info.counts.items():
                counts[connection] = counts.get(connection, 0) + count
        if not counts.keys() <= self._channels.keys():
            return None
        start_ns = min((info.start_ns for info in known), default=None)
        return Contents(self._channels, counts, start_ns, max((info.end_ns for info in known), default=None))
