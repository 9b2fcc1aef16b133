"""The other side of a live link: what a recorder, a Foxglove bridge, or a vehicle's ROS would send, from the messages of a log."""

from __future__ import annotations

import json
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from lhdmap.live.source import Announced, LiveMessage
from lhdmap.logs.formats import open_log
from lhdmap.logs.ros_messages import definition
from mcap.writer import CompressionType, Writer


class Sent(NamedTuple):
    """One message to send."""

    topic: str
    type_name: str
    log_time_ns: int
    data: bytes


def messages_of(log: Path) -> list[Sent]:
    """Return the messages of a log as they are stored."""
    with open_log(log) as reader:
        raw: Any = reader
        return [Sent(one.channel.topic, one.channel.type_name, one.log_time_ns, bytes(one.data)) for one in raw.raw()]


def paced(messages: Sequence[Sent], speed: float) -> Iterator[Sent]:
    """Yield messages at the pace of their log times, `speed` times as fast."""
    began_s, first_ns = time.monotonic(), messages[0].log_time_ns
    for message in messages:
        ahead_s = (message.log_time_ns - first_ns) * 1e-9 / speed - (time.monotonic() - began_s)
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        yield message


class GrowingLog:
    """Writes messages into an MCAP file that is flushed after each."""

    def __init__(self, path: Path, chunk_size: int = 0) -> None:
        self._file = path.open("wb")
        chunked = {"chunk_size": chunk_size} if chunk_size else {"use_chunking": False}
        self._writer = Writer(self._file, compression=CompressionType.ZSTD, **chunked)
        self._writer.start(profile="ros2", library="test")
        self._channels: dict[str, int] = {}

    def write(self, message: Sent) -> None:
        """Write one message."""
        if message.topic not in self._channels:
            text = definition(message.type_name).encode()
            schema = self._writer.register_schema(message.type_name, "ros2msg", text)
            self._channels[message.topic] = self._writer.register_channel(message.topic, "cdr", schema)
        at_ns = message.log_time_ns
        self._writer.add_message(self._channels[message.topic], at_ns, message.data, at_ns)
        self._file.flush()

    def finish(self) -> None:
        """Complete the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()

    def break_off(self) -> None:
        """Leave the file as a recorder that was killed does."""
        self._file.close()


class Caught:
    """A sink that keeps what comes."""

    def __init__(self) -> None:
        self.messages: list[LiveMessage] = []
        self.topics: dict[str, Announced] = {}
        self.holes: dict[str, int] = {}
        self.said: list[str] = []
        self.given_up = 0
        self._changed = threading.Condition()

    def announce(self, topic: Announced) -> None:
        self.topics[topic.topic] = topic

    def put(self, message: LiveMessage) -> None:
        with self._changed:
            self.messages.append(message)
            self._changed.notify_all()

    def missed(self, topic: str, count: int) -> None:
        self.holes[topic] = self.holes.get(topic, 0) + count

    def backlog_given_up(self) -> None:
        self.given_up += 1

    def say(self, text: str) -> None:
        self.said.append(text)

    def wait_for(self, count: int, timeout_s: float = 10.0) -> None:
        """Wait until so many messages have come."""
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.messages) >= count, timeout_s), len(self.messages)


@contextmanager
def running(target: Callable[..., object], *arguments: object) -> Iterator[threading.Thread]:
    """Run something in a thread that must have ended after the block."""
    thread = threading.Thread(target=target, args=arguments, daemon=True)
    thread.start()
    yield thread
    thread.join(20.0)
    assert not thread.is_alive()


class Bridge:
    """A Foxglove server: sends `messages` to who subscribes; `delay_s`: how old what it sends is, by message number."""

    def __init__(self, messages: Sequence[Sent], speed: float, delay_s: Callable[[int], float] | None = None) -> None:
        self.messages, self.speed, self._delay_s = list(messages), speed, delay_s
        self.offered: list[list[str]] = []
        self.next = 0
        self.cut_at: set[int] = set()
        self.cuts = 0

    @contextmanager
    def served(self) -> Iterator[str]:
        """Serve on a free port of this machine; yield the address."""
        from websockets.sync.server import serve

        with serve(
            self._serve,
            "127.0.0.1",
            0,
            subprotocols=["foxglove.sdk.v1"],  # type: ignore[list-item]
            select_subprotocol=self._chosen,
            compression=None,
        ) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
            server.shutdown()
            thread.join(5.0)

    def _chosen(self, _link: Any, offered: Any) -> Any:
        self.offered.append(list(offered))
        return "foxglove.sdk.v1"

    def _serve(self, link: Any) -> None:
        kinds = {message.topic: message.type_name for message in self.messages}
        channels = [
            {"id": 10 + k, "topic": topic, "encoding": "cdr", "schemaName": kind, "schema": definition(kind)}
            for k, (topic, kind) in enumerate(kinds.items())
        ]
        numbers = {str(one["topic"]): one["id"] for one in channels}
        link.send(json.dumps({"op": "serverInfo", "name": "test", "capabilities": []}))
        link.send(json.dumps({"op": "advertise", "channels": channels}))
        told = json.loads(link.recv())
        subscriptions = {one["channelId"]: one["id"] for one in told["subscriptions"]}
        for message in paced(self.messages[self.next :], self.speed):
            if self.next in self.cut_at:
                self.cut_at.discard(self.next)
                self.cuts += 1
                link.socket.close()
                return
            at_ns = message.log_time_ns
            if self._delay_s is not None:
                at_ns = time.time_ns() - round(1e9 * self._delay_s(self.next))
            self.next += 1
            link.send(struct.pack("<BIQ", 1, subscriptions[numbers[message.topic]], at_ns) + message.data)
        link.close()
