"""What is in a log file: topics with counts, rates and gaps, time covered, size and hash, damage."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from lhdmap.logs.base import LogReader

_STEP = 1 << 20


@dataclass(frozen=True, slots=True)
class TopicSummary:
    """One topic: `rate_hz` from its stamps; `max_gap_s` the longest time between two messages; None where not known."""

    name: str
    type_name: str
    role: str | None
    count: int | None
    rate_hz: float | None
    max_gap_s: float | None


@dataclass(frozen=True)
class Inventory:
    """One log file; rates and gaps are there once the log has been read."""

    path: Path
    format: str
    duration_s: float | None
    start_ns: int | None
    end_ns: int | None
    size_bytes: int
    topics: dict[str, TopicSummary] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @cached_property
    def sha256(self) -> str:
        """Hash of the file (of a folder: of the hashes of its files by name), computed when it is first asked for."""
        if self.path.is_dir():
            lines = [f"{_hash(file)}  {file.name}\n" for file in _files(self.path)]
            return hashlib.sha256("".join(lines).encode()).hexdigest()
        return _hash(self.path)


def take_inventory(reader: LogReader, roles: Mapping[str, str] | None = None) -> Inventory:
    """Return the inventory of an open log; `roles` tells the topic of each role."""
    by_topic = {topic: role for role, topic in (roles or {}).items()}
    topics = {name: _summary(reader, name, by_topic.get(name)) for name in reader.topics()}
    size = sum(file.stat().st_size for file in _files(reader.path))
    times = reader.duration_s, reader.start_ns, reader.end_ns
    return Inventory(reader.path, reader.format, *times, size, topics, reader.damage, reader.remarks)


def _summary(reader: LogReader, name: str, role: str | None) -> TopicSummary:
    info, seen = reader.topics()[name], reader.stamps.get(name)
    rate = gap = None
    if seen is not None and seen.count > 1 and seen.last_ns > seen.first_ns:
        rate = (seen.count - 1) / ((seen.last_ns - seen.first_ns) / 1e9)
        gap = seen.max_gap_ns / 1e9
    elif info.count is not None and reader.duration_s:
        rate = info.count / reader.duration_s
    return TopicSummary(name, info.type_name, role, info.count, rate, gap)


def _files(path: Path) -> list[Path]:
    return sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]


def _hash(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while part := file.read(_STEP):
            digest.update(part)
    return digest.hexdigest()
