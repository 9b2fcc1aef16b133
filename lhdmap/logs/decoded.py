"""A container's messages decoded and stamped: the `LogReader` of MCAP files, bags and databases."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator, Mapping
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.logs.base import RUN, Channel, RawMessage, TopicInfo, run_stride, span_s
from lhdmap.logs.clock import ClockStep, LogClock, Timed
from lhdmap.logs.cloud_times import CloudTimes
from lhdmap.logs.container import Container, Contents, OpenContainer
from lhdmap.logs.cursor import Cursor
from lhdmap.logs.decoders import DECODERS, UNSTAMPED_TYPES, Decoder, ground_truth, scan_numbers, transforms
from lhdmap.logs.findings import Findings
from lhdmap.logs.kinds import of_one_type
from lhdmap.logs.pointcloud import point_cloud
from lhdmap.logs.stamp_clocks import Sample, StampClocks, find_clocks
from lhdmap.logs.stamps import StampKeeper, TopicStamps
from lhdmap.logs.topics import is_ground_truth
from lhdmap.messages import Message, Mount, Record
from lhdmap.roles import ODOMETRY, SCAN

_ENCODINGS = frozenset({"cdr", "ros1"})
_FIRST_NS = 1_000_000_000


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
        self._clocks: StampClocks | None = None
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
    def clock_steps(self) -> list[ClockStep]:
        """Where the clock was set while the log was recorded, as far as it was read."""
        return self._keeper.steps

    def recorded_ns(self, topic: str, stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return stamps (N,) of a topic as they stand in the log."""
        return self._keeper.recorded_ns(topic, stamps_ns)

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
            if channel.type_name != SCAN or channel.encoding not in _ENCODINGS:
                continue
            try:
                return scan_numbers(Cursor(data, channel.encoding))[2][1]
            except InputError:
                continue
        return None

    def sample(self, most: Mapping[str, int]) -> Iterator[Record]:
        """Yield about `most` messages of each topic, in short runs spread over the log; their stamps as they were recorded."""
        plans = self._plans(most)
        counts = self._contents().counts
        strides = {number: run_stride(counts.get(number, 0), most[plan.topic]) for number, plan in plans.items()}
        met = dict.fromkeys(plans, 0)
        for log_ns, number, data in self._need().messages(plans):
            met[number] += 1
            if (met[number] - 1) % strides[number] < RUN:
                for message in self._decoded(plans[number], data):
                    yield Record(plans[number].topic, log_ns, message)

    def records(self, topics: Collection[str] | None = None) -> Iterator[Record]:
        """Yield the decoded messages of `topics` (all that can be decoded by default) in log-time order."""
        known = self._with_times(self._plans(topics))
        self._keeper = keeper = StampKeeper(self._stamp_clocks(), LogClock())
        self._skipped = Findings()
        for topic, log_ns, message, stamped in keeper.clock.steady(self._stream(known)):
            stamp = keeper.decide(topic, message.stamp_ns, log_ns, has_header=stamped)
            yield Record(topic, log_ns, message if stamp == message.stamp_ns else restamped(message, stamp))

    def _stream(self, plans: Mapping[int, _Plan]) -> Iterator[Timed]:
        for log_ns, number, data in self._need().messages(plans):
            plan = plans[number]
            for message in self._decoded(plan, data):
                yield Timed(plan.topic, log_ns, message, plan.stamped)

    def _stamp_clocks(self) -> StampClocks:
        """Return the clocks of the log, whichever topics are asked for; the truth has no say."""
        if self._clocks is None:
            self._clocks = find_clocks(self._first_stamps())
        return self._clocks

    def _first_stamps(self) -> Iterator[Sample]:
        plans = {
            number: plan
            for number, plan in self._plans(None).items()
            if plan.stamped and plan.decoder is not ground_truth
        }
        end_ns: int | None = None
        for log_ns, number, data in self._need().messages(plans):
            end_ns = log_ns + _FIRST_NS if end_ns is None else end_ns
            if log_ns > end_ns:
                return
            with contextlib.suppress(InputError):
                yield Sample(plans[number].topic, Cursor(data, plans[number].encoding).header()[0], log_ns)

    def _decoded(self, plan: _Plan, data: bytes) -> tuple[Message, ...]:
        try:
            messages = plan.decoder(Cursor(data, plan.encoding))
        except InputError as error:
            self._skipped.add(f"{plan.topic}: a message was skipped: {error}")
            return ()
        return tuple(filter(self._is_pose, messages)) if plan.decoder is transforms else messages

    def _is_pose(self, message: Message) -> bool:
        """Return whether a transform is one; what is none is dropped alone, and told of."""
        usable = isinstance(message, Mount) and bool(np.isfinite(message.T_parent_child).all())
        if not usable and isinstance(message, Mount):
            self._skipped.add(f"a transform to '{message.child_frame}' that is no pose was left out")
        return usable

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
        if truth and channel.type_name == ODOMETRY:
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
