"""A live stream as a log: the container that the readers of `lhdmap.logs` decode, so that clocks, stamps and repairs are theirs.

The first seconds are kept, since a log is looked through before it is used; then messages go by.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator

from lhdmap.errors import InputError
from lhdmap.live.inbox import Inbox
from lhdmap.live.source import LiveMessage
from lhdmap.logs.base import Channel
from lhdmap.logs.compression import inflated
from lhdmap.logs.container import Contents
from lhdmap.logs.findings import Findings
from lhdmap.roles import CLOUD, ROLES, SCAN

LOOKED_AT_NS = 2_000_000_000  # of a scanner; the clocks of a log are told by its first second
_MOST_KEPT = 20_000
_SCANNERS = (SCAN, CLOUD)
_POLL_S = 0.1
_NODE = ROLES["node"]  # the operator says nothing for minutes; the topic's name is fixed


class LiveContainer:
    """A `Container` over an inbox. `idle` is called several times a second while nothing comes."""

    def __init__(self, inbox: Inbox, idle: Callable[[], None] = lambda: None) -> None:
        self.format = "live"
        self.remarks = Findings()
        self._inbox, self._idle = inbox, idle
        self._channels: dict[int, Channel] = {}
        self._numbers: dict[Channel, int] = {}
        self._counts: dict[int, int] = {}
        self._start_ns: int | None = None
        self._end_ns: int | None = None
        self._kept: deque[tuple[int, int, bytes]] = deque()
        self._looked_at: frozenset[int] | None = None
        self._flows = False

    def look(self) -> None:
        """Wait for a scanner, and keep what comes in its first two seconds.

        Raises:
            InputError: the stream ended without a message.
        """
        began_ns: int | None = None
        while not self._inbox.over:
            message = self._next()
            if message is None:
                continue
            self._kept.append(self._taken(message))
            if began_ns is None and message.type_name in _SCANNERS:
                began_ns = message.log_time_ns
            if began_ns is not None and abs(message.log_time_ns - began_ns) > LOOKED_AT_NS:
                break
            if len(self._kept) > _MOST_KEPT and began_ns is None:
                self._kept.popleft()  # no scanner yet: what was before it places nothing
        for topic in list(self._inbox.announced.values()):
            self._number(Channel(topic.topic, topic.type_name, topic.encoding))
        if not self._kept:
            raise InputError("the stream ended without a message")
        self._number(Channel(_NODE.topic, _NODE.type_name, "cdr"))
        self._looked_at = frozenset(self._channels)

    def flow(self) -> None:
        """From now on `messages` gives each message once, as it comes."""
        self._flows = True

    def contents(self) -> Contents:
        """Return what has come so far."""
        return Contents(self._channels, self._counts, self._start_ns, self._end_ns)

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes of the wanted channels in the order in which they came."""
        keep = frozenset(wanted)
        for time_ns, channel, data in self._came() if self._flows else list(self._kept):
            if channel in keep:
                yield time_ns, channel, inflated(data)

    def close(self) -> None:
        """Nothing is held open here."""

    def _came(self) -> Iterator[tuple[int, int, bytes]]:
        yield from list(
            self._kept
        )  # the clocks are looked for in the first second once more: until here nothing is used up
        self._kept.clear()
        while not self._inbox.over:
            message = self._next()
            if message is not None:
                yield self._taken(message)

    def _next(self) -> LiveMessage | None:
        message = self._inbox.get(_POLL_S)
        if message is None:
            self._idle()
        return message

    def _taken(self, message: LiveMessage) -> tuple[int, int, bytes]:
        number = self._number(Channel(message.topic, message.type_name, message.encoding))
        self._counts[number] = self._counts.get(number, 0) + 1
        at_ns = message.log_time_ns
        self._start_ns = at_ns if self._start_ns is None else min(self._start_ns, at_ns)
        self._end_ns = at_ns if self._end_ns is None else max(self._end_ns, at_ns)
        return at_ns, number, message.data

    def _number(self, channel: Channel) -> int:
        number = self._numbers.get(channel)
        if number is None:
            number = self._numbers[channel] = len(self._numbers)
            self._channels[number] = channel
            if self._looked_at is not None:
                self._inbox.say(f"{channel.topic} came late: it is in the log, and takes no part in this run")
        return number
