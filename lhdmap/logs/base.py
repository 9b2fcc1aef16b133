"""The one face of all log formats: `LogReader`; readers are chosen by `lhdmap.logs.formats.open_log`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Protocol, Self

import numpy as np
import numpy.typing as npt

from lhdmap.logs.clock import ClockStep
from lhdmap.logs.stamps import TopicStamps
from lhdmap.messages import Record


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One topic of a log: `type_name` in ROS 2 form (`sensor_msgs/msg/LaserScan`), `count` None where not known yet."""

    name: str
    type_name: str
    count: int | None
    frame_id: str | None = None


class Channel(NamedTuple):
    """How the messages of one topic are stored: `encoding` is `cdr` (ROS 2), `ros1`, or one that is not decoded."""

    topic: str
    type_name: str
    encoding: str


class RawMessage(NamedTuple):
    """One message as stored: its channel, log time and bytes."""

    channel: Channel
    log_time_ns: int
    data: bytes | memoryview


class LogReader(Protocol):
    """A log, read lazily in log-time order with bounded memory; a context manager.

    What is damaged is skipped and noted in `damage`; what is odd but usable in `remarks`. Both fill while reading.
    Log times are integer nanoseconds, None where the log has no message. `truth_topics` names ground-truth topics
    beyond those whose name says so.
    """

    path: Path
    format: str
    truth_topics: frozenset[str]

    def __enter__(self) -> Self:
        """Open the log; raises InputError where it is not usable."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the log."""

    @property
    def damage(self) -> list[str]:
        """What was cut off, broken or skipped, one line each."""

    @property
    def remarks(self) -> list[str]:
        """What was noticed and worked round, one line each."""

    @property
    def stamps(self) -> dict[str, TopicStamps]:
        """Statistics of the stamps of each topic read so far."""

    @property
    def clock_steps(self) -> list[ClockStep]:
        """Where the clock was set while the log was recorded, as far as it was read."""

    def recorded_ns(self, topic: str, stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return stamps (N,) of a topic as they stand in the log: where a clock was set, messages carry one that runs on."""

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""

    @property
    def duration_s(self) -> float | None:
        """Log time from the first to the last message, seconds."""

    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics by name."""

    def stated_end_rad(self, topic: str) -> float | None:
        """Return the angle that the log states for the last beam of a scanner's first scan, None where it does not."""

    def sample(self, most: Mapping[str, int]) -> Iterator[Record]:
        """Yield about `most` messages of each topic, in short runs spread over the log; their stamps as they were recorded."""

    def records(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Yield the decoded messages of `topics` (all that can be decoded by default)."""


def span_s(start_ns: int | None, end_ns: int | None) -> float | None:
    """Return the time from start to end in seconds, None where either is unknown."""
    return None if start_ns is None or end_ns is None else (end_ns - start_ns) / 1e9


RUN = 4
"""So many messages in a row are taken of a sample: what alternates shows in it."""


def run_stride(count: int, most: int) -> int:
    """Return after how many of `count` messages the next run begins, so that about `most` are taken."""
    return max(RUN * (count // max(most, 1)), RUN)
