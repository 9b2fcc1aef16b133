"""What the readers of text logs share: stamps, damage and remarks, one line after the other."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from lhdmap.logs.base import TopicInfo, span_s
from lhdmap.logs.findings import Findings
from lhdmap.logs.stamps import StampKeeper, TopicStamps
from lhdmap.logs.text_lines import text_lines
from lhdmap.messages import Message, Record


class Found(NamedTuple):
    """One message of a line; `stamped` tells whether its stamp is a measurement's."""

    topic: str
    log_time_ns: int
    message: Message
    stamped: bool


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

    def records(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Yield the messages of `topics` (all by default) in the order of the file."""
        self._keeper = keeper = StampKeeper()
        for topic, log_ns, message, stamped in self._messages(self.topics().keys() if topics is None else topics):
            stamp = keeper.decide(topic, message.stamp_ns, log_ns, has_header=stamped)
            yield Record(topic, log_ns, message if stamp == message.stamp_ns else message._replace(stamp_ns=stamp))

    @abstractmethod
    def _survey(self) -> None: ...

    @abstractmethod
    def _messages(self, topics: Collection[str]) -> Iterator[Found]: ...

    def _lines(self) -> Iterator[bytes]:
        self._damage = Findings()
        return text_lines(self.path, self._damage)

    def _notes_damage(self, text: str) -> None:
        self._damage.add(text)
