"""What the readers of text logs share: stamps, damage and remarks, one line after the other."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from lhdmap.logs.base import RUN, TopicInfo, run_stride, span_s
from lhdmap.logs.clock import ClockStep
from lhdmap.logs.findings import Findings
from lhdmap.logs.stamps import StampKeeper, TopicStamps
from lhdmap.logs.text.lines import text_lines
from lhdmap.messages import Message, Record


class FoundLine(NamedTuple):
    """One message of a line; `stamped` tells whether its stamp is a measurement's."""

    topic: str
    log_time_ns: int
    message: Message
    stamped: bool


Wanted = Callable[[str], bool]


def every(_: str) -> bool:
    """Want each message."""
    return True


class TextLog(ABC):
    """A `LogReader` of a text log; a format says what is in it (`_survey`, `topics`) and gives its messages."""

    format = "text"

    def __init__(self, path: Path) -> None:
        self.path = path
        self.truth_topics: frozenset[str] = frozenset()
        self._start_ns: int | None = None
        self._end_ns: int | None = None
        self._notes = Findings()
        self._damage = Findings()
        self._keeper = StampKeeper()

    def __enter__(self) -> Self:
        """Look through the log; raises InputError where it is not of this format."""
        self._survey()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the log: nothing is held open between reads."""
        self._keeper = StampKeeper()

    @property
    def damage(self) -> list[str]:
        """What was cut off, broken or skipped, one line each."""
        return self._damage.lines()

    @property
    def remarks(self) -> list[str]:
        """What was odd but usable."""
        return self._notes.lines() + self._keeper.warnings()

    @property
    def stamps(self) -> dict[str, TopicStamps]:
        """Statistics of the stamps of each topic read so far."""
        return self._keeper.topics

    @property
    def clock_steps(self) -> list[ClockStep]:
        """Where the clock was set: not looked for, since old loggers let stamps and log times run backwards all the time."""
        return []

    def recorded_ns(self, topic: str, stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:  # noqa: ARG002
        """Return stamps (N,) of a topic as they stand in the log."""
        return stamps_ns

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""
        return self._start_ns

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""
        return self._end_ns

    @property
    def duration_s(self) -> float | None:
        """Log time from the first to the last message, seconds."""
        return span_s(self._start_ns, self._end_ns)

    @abstractmethod
    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics by name."""

    def stated_end_rad(self, topic: str) -> float | None:  # noqa: ARG002  # for formats that state it
        """Return the angle that the log states for the last beam, None where it does not."""
        return None

    def sample(self, most: Mapping[str, int]) -> Iterator[Record]:
        """Yield about `most` messages of each topic, in short runs spread over the log; their stamps as they were recorded."""
        strides = {
            name: run_stride(info.count or 0, most[name]) for name, info in self.topics().items() if name in most
        }
        met = dict.fromkeys(strides, 0)

        def wanted(topic: str) -> bool:
            met[topic] += 1
            return (met[topic] - 1) % strides[topic] < RUN

        for topic, log_ns, message, _ in self._messages(strides.keys(), wanted):
            yield Record(topic, log_ns, message)

    def records(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Yield the messages of `topics` (all by default) in the order of the file."""
        self._keeper = keeper = StampKeeper()
        for topic, log_ns, message, stamped in self._messages(self.topics().keys() if topics is None else topics):
            stamp = keeper.decide(topic, message.stamp_ns, log_ns, has_header=stamped)
            yield Record(topic, log_ns, message if stamp == message.stamp_ns else message._replace(stamp_ns=stamp))

    @abstractmethod
    def _survey(self) -> None: ...

    @abstractmethod
    def _messages(self, topics: Collection[str], wanted: Wanted = every) -> Iterator[FoundLine]:
        """Yield the messages of `topics`; `wanted(topic)` is asked before one is parsed."""

    def _lines(self) -> Iterator[bytes]:
        self._damage = Findings()
        return text_lines(self.path, self._damage)

    def _notes_damage(self, text: str) -> None:
        self._damage.add(text)
