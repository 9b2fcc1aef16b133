"""`LiveSource`: where messages of a running machine come from, whatever carries them."""

from __future__ import annotations

import threading
from typing import NamedTuple, Protocol

from lhdmap.logs.decoders import DECODERS

WANTED = frozenset(DECODERS)
"""Types that some stage can read; of a link only these are asked for, since pictures would fill it."""


class LiveMessage(NamedTuple):
    """One message as it came: topic, type in ROS 2 form, log time (ns), its bytes and how they are encoded (`cdr`, `ros1`)."""

    topic: str
    type_name: str
    log_time_ns: int
    data: bytes
    encoding: str = "cdr"


class Announced(NamedTuple):
    """A topic that a source offers; `definition`: that of its type (`ros2msg`), empty where the source does not tell."""

    topic: str
    type_name: str
    encoding: str = "cdr"
    definition: str = ""


class LinkLost(Exception):  # what happened; a link is made again
    """The link broke, or is no use any more: the text says why."""


class Sink(Protocol):
    """What takes the messages of a source; any thread may call."""

    def announce(self, topic: Announced) -> None:
        """Take note of a topic that there is."""
        ...

    def put(self, message: LiveMessage) -> None:
        """Take a message."""
        ...

    def missed(self, topic: str, count: int) -> None:
        """Take note of messages that the sender counted and that did not come."""
        ...

    def backlog_given_up(self) -> None:
        """Take note that messages which the sender still held were given up for newer ones."""
        ...

    def say(self, text: str) -> None:
        """Tell a person something."""
        ...


class LiveSource(Protocol):
    """A source of messages.

    Attributes:
        address: how a user names it.
        waits: whether it can wait for a slow reader (a file); else messages are dropped and counted.
    """

    address: str
    waits: bool

    def run(self, sink: Sink, stop: threading.Event) -> None:
        """Put messages into the sink until `stop` is set or the source has ended.

        Raises:
            LinkLost: the link broke; the caller may call again.
            InputError: the source cannot be used.
        """
        ...
