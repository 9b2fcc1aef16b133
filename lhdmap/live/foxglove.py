"""A Foxglove WebSocket server (foxglove_bridge, port 8765): JSON about channels, binary frames with CDR in them.

The protocol: https://github.com/foxglove/ws-protocol, and that of the Foxglove SDK, which differs only in its name here.
"""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Mapping
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from lhdmap.errors import UsageError
from lhdmap.live.backlog import Backlog
from lhdmap.live.source import WANTED, Announced, LinkLost, LiveMessage, Sink
from lhdmap.logs.mcap.records import ros2_type

SUBPROTOCOLS = (
    "foxglove.sdk.v1",
    "foxglove.websocket.v1",
)  # servers of the SDK refuse a client that offers the old one alone
_ENCODINGS = ("cdr", "ros1")
_DATA, _HEAD = 0x01, struct.Struct("<BIQ")
_WAIT_S, _OPEN_S = 0.2, 5.0
_SILENT_S = 5.0  # a link over which nothing at all has come for so long is made again: a dead Wi-Fi says nothing
_MOST_BYTES = 64 << 20


class Foxglove:
    """A `LiveSource`: subscribes to all topics that some stage can read."""

    waits = False

    def __init__(self, url: str) -> None:
        self.address = f"foxglove:{url}"
        self._url = url
        self._least_late_ns: int | None = None

    def run(self, sink: Sink, stop: threading.Event) -> None:
        """Put what the server sends into the sink.

        Raises:
            LinkLost: no connection, it broke, or the server serves its backlog.
            UsageError: the address is none.
        """
        try:
            link = connect(
                self._url,
                subprotocols=[Subprotocol(name) for name in SUBPROTOCOLS],
                open_timeout=_OPEN_S,
                close_timeout=0.5,
                max_size=_MOST_BYTES,
                compression=None,
            )
        except InvalidURI as error:
            raise UsageError(f"{self._url}: ws://HOST:8765 was wanted") from error
        except (OSError, InvalidHandshake, TimeoutError) as error:
            raise LinkLost(f"no connection ({error})") from error
        with link:
            try:
                self._receive(link, _Channels(sink), stop)
            except ConnectionClosed as error:
                raise LinkLost(f"the connection broke ({error})") from error

    def _receive(self, link: ClientConnection, channels: _Channels, stop: threading.Event) -> None:
        backlog, silent_s = Backlog(self._least_late_ns), 0.0
        while not stop.is_set():
            try:
                frame = link.recv(timeout=_WAIT_S)
            except TimeoutError:
                silent_s += _WAIT_S
                if silent_s > _SILENT_S:
                    raise LinkLost(f"nothing came for {silent_s:.0f} s") from None
                continue
            silent_s = 0.0
            if isinstance(frame, str):
                wanted = channels.told(json.loads(frame))
                if wanted:
                    link.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                continue
            sent_ns = channels.taken(frame)
            if sent_ns is not None and backlog.served_late(sent_ns):
                channels.sink.backlog_given_up()
                raise LinkLost(f"the server serves what is {backlog.late_s:.1f} s old: given up for what is new")
            self._least_late_ns = backlog.least_late_ns


class _Channels:
    """The channels of one connection, and what was subscribed to."""

    def __init__(self, sink: Sink) -> None:
        self.sink = sink
        self._topics: dict[int, Announced] = {}

    def told(self, told: Mapping[str, Any]) -> list[dict[str, int]]:
        """Take a JSON message; return the subscriptions to ask for."""
        wanted = []
        for channel in told.get("channels", ()) if told.get("op") == "advertise" else ():
            kind, encoding = ros2_type(str(channel["schemaName"])), str(channel["encoding"])
            if kind in WANTED and encoding in _ENCODINGS:
                number = int(channel["id"])
                text = str(channel.get("schema", ""))
                self._topics[number] = Announced(str(channel["topic"]), kind, encoding, text)
                self.sink.announce(self._topics[number])
                wanted.append({"id": number, "channelId": number})
        return wanted

    def taken(self, frame: bytes) -> int | None:
        """Take a binary message; return the time that it was sent at, None where it holds no data of ours."""
        if len(frame) < _HEAD.size:
            return None
        kind, subscription, sent_ns = _HEAD.unpack_from(frame)
        topic = self._topics.get(subscription)
        if kind != _DATA or topic is None:
            return None
        self.sink.put(LiveMessage(topic.topic, topic.type_name, sent_ns, frame[_HEAD.size :], topic.encoding))
        return int(sent_ns)
