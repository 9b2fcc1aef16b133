"""ROS 1 bags, version 2.0: chunks uncompressed, bz2 or lz4; indexed, not indexed, with a wrong index, or cut off."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from lhdmap.errors import InputError
from lhdmap.logs.bag import records as rec
from lhdmap.logs.bag.scan import BagScan
from lhdmap.logs.blocks import Entry
from lhdmap.logs.container import BlockFile, Contents
from lhdmap.logs.findings import Findings


class BagFile(BlockFile):
    """An open bag (a `Container`)."""

    format = "ROS 1 bag"

    def __init__(self, path: Path, damage: Findings) -> None:
        super().__init__()
        self._damage = damage
        self._file: BinaryIO = path.open("rb", buffering=1 << 16)
        start = self._file.read(len(rec.MAGIC))
        if start != rec.MAGIC:
            self._file.close()
            found = start.decode("ascii", "replace").strip() if start.startswith(b"#ROSBAG") else "other bytes"
            raise InputError(f"{path}: it begins with {found}, '#ROSBAG V2.0' was wanted; is it another format?")
        scan = BagScan(self._file, path.stat().st_size, damage)
        scan.run()
        self._channels = scan.channels
        self._blocks = scan.blocks
        self._contents = self._indexed(scan)

    def _entries(self, data: bytes) -> tuple[list[Entry], str | None]:
        return rec.messages(data, self._channels)

    def _indexed(self, scan: BagScan) -> Contents | None:
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
