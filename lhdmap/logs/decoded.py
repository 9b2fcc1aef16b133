"""A container's messages decoded and stamped: the `LogReader` of MCAP files, bags and databases."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from lhdmap.errors import InputError
from lhdmap.logs.base import Channel, RawMessage, TopicInfo, span_s
from lhdmap.logs.cloud_times import CloudTimes
from lhdmap.logs.container import Container, Contents, OpenContainer
from lhdmap.logs.cursor import Cursor
from lhdmap.logs.decoders import DECODERS, LASER_SCAN, UNSTAMPED_TYPES, Decoder, ground_truth, scan_numbers
from lhdmap.logs.findings import Findings
from lhdmap.logs.kinds import of_one_type
from lhdmap.logs.pointcloud import point_cloud
from lhdmap.logs.stamps import StampKeeper, TopicStamps
from lhdmap.logs.topics import is_ground_truth
from lhdmap.messages import Message, Record

_ENCODINGS = frozenset({"cdr", "ros1"})


class DecodedLog:
    """A `LogReader` over a container."""

    def __init__(self, path: Path, open_container: OpenContainer) -> None:
        self.path = path
        self.format = "unknown"
        self.truth_topics: frozenset[str] = frozenset()
        self._open = open_container
        self._container: Container | None = None
        self._findings = Findings()
        self._skipped = Findings()
        self._keeper = StampKeeper()
        self._cloud_times: dict[str, CloudTimes] = {}

    def __enter__(self) -> Self:
        """Open the log; raises InputError where it is not usable."""
        self._container = self._open(self.path, self._findings)
        self.format = self._container.format
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the log."""
        if self._container is not None:
            self._container.close()

    @property
    def damage(self) -> list[str]:
        """What was cut off, broken or skipped, one line each."""
        return self._findings.lines() + self._skipped.lines()

    @property
    def remarks(self) -> list[str]:
        """What was odd in the file, its topics and the times in it."""
        clouds = [line for topic, times in self._cloud_times.items() for line in times.remarks(topic)]
        return [*self._need().remarks.lines(), *self._typed()[1], *self._keeper.warnings(), *clouds]

    @property
    def stamps(self) -> dict[str, TopicStamps]:
        """Statistics of the stamps of each topic read so far."""
        return self._keeper.topics

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""
        return self._contents().start_ns

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""
        return self._contents().end_ns

    @property
    def duration_s(self) -> float | None:
        """Log time from the first to the last message, seconds."""
        return span_s(self.start_ns, self.end_ns)

    def topics(self) -> dict[str, TopicInfo]:
        """Return the topics by name; channels of one topic and type are added up, of several types one is chosen."""
        return self._typed()[0]

    def _typed(self) -> tuple[dict[str, TopicInfo], list[str]]:
        contents = self._contents()
        return of_one_type(
            TopicInfo(channel.topic, channel.type_name, contents.counts.get(number, 0))
            for number, channel in contents.channels.items()
        )

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Yield the messages of `topics` (all by default) as they are stored, in log-time order."""
        channels = self._chosen(topics)
        for log_ns, number, data in self._need().messages(channels):
            yield RawMessage(channels[number], log_ns, data)

    def stated_end_rad(self, topic: str) -> float | None:
        """Return the `angle_max` of the first LaserScan of `topic`, None where there is none."""
        for channel, _, data in self.raw({topic}):
            if channel.type_name != LASER_SCAN or channel.encoding not in _ENCODINGS:
                continue
            try:
                return scan_numbers(Cursor(data, channel.encoding))[2][1]
            except InputError:
                continue
        return None

    def records(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Yield the decoded messages of `topics` (all that can be decoded by default) in log-time order."""
        known = self._with_times(self._plans(topics))
        self._keeper = keeper = StampKeeper()
        self._skipped = Findings()
        for log_ns, number, data in self._need().messages(known):
            plan = known[number]
            for message in self._decoded(plan, data):
                stamp = keeper.decide(plan.topic, message.stamp_ns, log_ns, has_header=plan.stamped)
                yield Record(plan.topic, log_ns, message if stamp == message.stamp_ns else restamped(message, stamp))

    def _decoded(self, plan: _Plan, data: bytes) -> tuple[Message, ...]:
        try:
            return plan.decoder(Cursor(data, plan.encoding))
        except InputError as error:
            self._skipped.add(f"{plan.topic}: a message was skipped: {error}")
            return ()

    def _plans(self, topics: Collection[str] | None) -> dict[int, _Plan]:
        """Return how to decode the channels of `topics` (all by default) that can be decoded."""
        kinds = {name: info.type_name for name, info in self.topics().items()}
        chosen = {
            n: channel for n, channel in self._chosen(topics).items() if channel.type_name == kinds[channel.topic]
        }
        plans = {number: self._plan(channel) for number, channel in chosen.items()}
        return {number: plan for number, plan in plans.items() if plan is not None}

    def _with_times(self, plans: dict[int, _Plan]) -> dict[int, _Plan]:
        """Let the clouds of each topic share what is known of their times."""
        self._cloud_times = {plan.topic: CloudTimes() for plan in plans.values() if plan.decoder is point_cloud}
        return {
            number: plan._replace(decoder=partial(point_cloud, times=self._cloud_times[plan.topic]))
            if plan.decoder is point_cloud
            else plan
            for number, plan in plans.items()
        }

    def _plan(self, channel: Channel) -> _Plan | None:
        truth = channel.topic in self.truth_topics or is_ground_truth(channel.topic)
        decoder = DECODERS.get(channel.type_name)
        if truth and channel.type_name == "nav_msgs/msg/Odometry":
            decoder = ground_truth
        if decoder is None or channel.encoding not in _ENCODINGS:
            return None
        return _Plan(channel.topic, decoder, channel.encoding, channel.type_name not in UNSTAMPED_TYPES)

    def _chosen(self, topics: Collection[str] | None) -> dict[int, Channel]:
        channels = self._contents().channels
        return {number: channel for number, channel in channels.items() if topics is None or channel.topic in topics}

    def _contents(self) -> Contents:
        return self._need().contents()

    def _need(self) -> Container:
        if self._container is None:
            raise InputError(f"{self.path}: the log is not open; use it in a `with` statement")
        return self._container


class _Plan(NamedTuple):
    """How to decode the messages of one channel."""

    topic: str
    decoder: Decoder
    encoding: str
    stamped: bool


def restamped(message: Message, stamp_ns: int) -> Message:
    """Return the message with another stamp."""
    return message._replace(stamp_ns=stamp_ns)
