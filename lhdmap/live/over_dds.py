"""ROS 2 over DDS without ROS: cyclonedds as a participant of the vehicle's domain (x86-64; no wheel for others)."""

from __future__ import annotations

import threading
import time
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException, InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from lhdmap.live.dds_types import raw_type
from lhdmap.live.source import WANTED, Announced, LinkLost, LiveMessage, Sink
from lhdmap.live.zenoh_keys import ros_type

_PREFIX = "rt/"
_DISCOVER_S, _WAIT_MS, _MOST = 0.5, 50, 64
_DEPTH = 64  # samples that a reader holds: over a second of a scanner
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any


class OverDds:
    """A `LiveSource`; log times are those of arrival. There is no link that could be lost: who comes is found."""

    waits = False

    def __init__(self, domain: int = 0) -> None:
        self.address = f"dds:{domain}"
        self._domain = domain

    def run(self, sink: Sink, stop: threading.Event) -> None:
        """Put what is published into the sink.

        Raises:
            LinkLost: no interface of this machine can be used.
        """
        try:
            participant = DomainParticipant(self._domain)
        except DDSException as error:
            raise LinkLost(f"no participant ({error})") from error
        readers, waiting = _Readers(participant, sink), WaitSet(participant)
        looked_s = 0.0
        while not stop.is_set():
            if time.monotonic() - looked_s > _DISCOVER_S:
                looked_s = time.monotonic()
                for condition in readers.discovered():
                    waiting.attach(condition)
            if not len(readers):
                stop.wait(0.05)
            elif waiting.wait(duration(milliseconds=_WAIT_MS)):
                readers.take()


class _Readers:
    """A reader for each topic that somebody publishes and some stage can read."""

    def __init__(self, participant: Any, sink: Sink) -> None:
        self._participant, self._sink = participant, sink
        self._publications = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
        self._readers: dict[str, tuple[Announced, Any]] = {}

    def __len__(self) -> int:
        return len(self._readers)

    def discovered(self) -> list[Any]:
        """Look for topics; return the conditions of new readers."""
        conditions = []
        for found in self._publications.take(N=_MOST):
            name, kind = str(found.topic_name), ros_type(str(found.type_name))
            if not name.startswith(_PREFIX) or kind not in WANTED or name in self._readers:
                continue
            topic = Announced("/" + name.removeprefix(_PREFIX), kind)
            reader = DataReader(self._participant, Topic(self._participant, name, raw_type(kind)), qos=_qos(found.qos))
            self._readers[name] = topic, reader
            self._sink.announce(topic)
            conditions.append(ReadCondition(reader, _ANY))
        return conditions

    def take(self) -> None:
        """Put all that has come into the sink."""
        for topic, reader in self._readers.values():
            for sample in reader.take(N=_MOST):
                if sample.sample_info.valid_data:
                    self._sink.put(LiveMessage(topic.topic, topic.type_name, time.time_ns(), sample.data))


def _qos(offered: Any) -> Any:
    """Return what a reader asks for: latched topics reliably and with what was sent before, sensors as they come."""
    latched = offered is not None and Policy.Durability.TransientLocal in offered
    if latched:
        return Qos(
            Policy.Reliability.Reliable(duration(seconds=1)),
            Policy.Durability.TransientLocal,
            Policy.History.KeepLast(_DEPTH),
        )
    return Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(_DEPTH))
