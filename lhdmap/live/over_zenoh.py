"""ROS 2 over zenoh (rmw_zenoh) without ROS: a client of the vehicle's zenoh router."""

from __future__ import annotations

import threading
import time
from typing import Any

import zenoh
from zenoh import ext

from lhdmap.live.source import WANTED, LinkLost, LiveMessage, Sink
from lhdmap.live.zenoh_keys import announced, dds_type, topic_of
from lhdmap.roles import TRANSFORMS

_LOOK_S, _GONE_S = 0.2, 1.0
_deserialized: Any = ext.z_deserialize


class OverZenoh:
    """A `LiveSource`; log times are those of arrival. Callbacks run in zenoh's threads and only fill the sink."""

    waits = False

    def __init__(self, endpoint: str, domain: int = 0) -> None:
        self.address = f"zenoh:{endpoint}"
        self._endpoint, self._domain = endpoint, domain

    def run(self, sink: Sink, stop: threading.Event) -> None:
        """Put what is published into the sink.

        Raises:
            LinkLost: the router cannot be reached, or is gone.
        """
        try:
            session: Any = zenoh.open(_config(self._endpoint))
        except zenoh.ZError as error:
            reason = str(error).partition(" at /")[0]  # where in zenoh's source is of no use here
            raise LinkLost(f"no connection ({reason})") from error
        try:
            held = self._subscribed(session, _Receiver(sink), sink)
            self._wait(session, stop)
            del held
        finally:
            session.close()

    def _subscribed(self, session: Any, receiver: _Receiver, sink: Sink) -> list[Any]:
        """Return the subscriptions: they hold as long as these objects."""

        def token(sample: Any) -> None:
            topic = announced(str(sample.key_expr))
            if topic is not None and topic.type_name in WANTED and sample.kind == zenoh.SampleKind.PUT:
                sink.announce(topic)

        held = [session.liveliness().declare_subscriber(f"@ros2_lv/{self._domain}/**", token, history=True)]
        for kind in sorted(WANTED):
            key = f"{self._domain}/**/{dds_type(kind)}/*"
            if kind == TRANSFORMS:  # latched: a plain subscriber that comes late gets nothing
                history = ext.HistoryConfig(detect_late_publishers=True)
                held.append(ext.declare_advanced_subscriber(session, key, receiver.take, history=history))
            else:
                held.append(session.declare_subscriber(key, receiver.take))
        return held

    def _wait(self, session: Any, stop: threading.Event) -> None:
        gone_since_s: float | None = None
        while not stop.wait(_LOOK_S):
            if session.info.routers_zid() or session.info.peers_zid():
                gone_since_s = None
                continue
            gone_since_s = gone_since_s or time.monotonic()
            if time.monotonic() - gone_since_s > _GONE_S:
                raise LinkLost("the other side is gone")


class _Receiver:
    """Samples into messages; holes in the publishers' own count are told, where they send one."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._last: dict[tuple[str, bytes], int] = {}

    def take(self, sample: Any) -> None:
        """Take one sample, in zenoh's thread."""
        found = topic_of(str(sample.key_expr))
        if found is None:
            return
        self._sink.put(LiveMessage(*found, time.time_ns(), sample.payload.to_bytes()))
        counted = _counted(sample.attachment)
        if counted is not None:
            number, publisher = counted
            key = found[0], publisher
            missed = number - self._last.get(key, number - 1) - 1
            self._last[key] = number
            if missed > 0:
                self._sink.missed(found[0], missed)


def _counted(attachment: Any) -> tuple[int, bytes] | None:
    """Return a sample's number and its publisher, from the attachment of rmw_zenoh 0.2.4 and later; None from any other."""
    if attachment is None:
        return None
    kind: Any = tuple[ext.Int64, ext.Int64, bytes]
    try:
        number, _, publisher = _deserialized(kind, attachment)
    except Exception:  # noqa: BLE001  # of another version: nothing depends on it
        return None
    return int(number), bytes(publisher)


def _config(endpoint: str) -> Any:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("connect/timeout_ms", "2000")
    config.insert_json5("scouting/multicast/enabled", "false")
    return config
