"""Which clock the stamps of a log are of: decided once, from the first second of all topics, and held for the whole log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

UNSTAMPED = 0
_AGREE_NS = 5_000_000_000  # stamps of one clock: a message waits no longer for its logger
_LATENCY_NS = 1_000_000_000


class Sample(NamedTuple):
    """Topic, header stamp (0: none) and log time of a message, nanoseconds."""

    topic: str
    header_ns: int
    log_ns: int


@dataclass(frozen=True, slots=True)
class StampClocks:
    """How the clocks of a log are related, nanoseconds.

    `offset_ns`: log time minus stamp where those are two clocks (simulation time, a log recorded anew), else 0.
    `foreign_ns`: what is added to the stamps of topics whose clock is another one than that of the others.
    `begin_at_zero`: topics whose first stamp of zero is a time, since their clock begins there.
    """

    offset_ns: int = 0
    foreign_ns: Mapping[str, int] = field(default_factory=dict)
    begin_at_zero: frozenset[str] = frozenset()

    def text(self, topic: str) -> str:
        """Return what is said of a topic with another clock."""
        by_s = self.foreign_ns[topic] / 1e9
        return (
            f"{topic}: its stamps are of another clock than the other topics': moved by {by_s:.3f} s, by the log times"
        )


ONE_CLOCK = StampClocks()


def find_clocks(samples: Iterable[Sample]) -> StampClocks:
    """Return the clocks of a log from the messages of its first second."""
    by_topic: dict[str, list[Sample]] = {}
    for sample in samples:
        by_topic.setdefault(sample.topic, []).append(sample)
    stamped = {topic: [one for one in listed if one.header_ns != UNSTAMPED] for topic, listed in by_topic.items()}
    offsets = {topic: min(one.log_ns - one.header_ns for one in listed) for topic, listed in stamped.items() if listed}
    if not offsets:
        return ONE_CLOCK
    reference_ns = _reference(offsets, {topic: len(listed) for topic, listed in stamped.items()})
    foreign = {topic: ns - reference_ns for topic, ns in offsets.items() if abs(ns - reference_ns) > _AGREE_NS}
    offset_ns = reference_ns if abs(reference_ns) > _LATENCY_NS else 0
    at_zero = frozenset(
        topic
        for topic, listed in by_topic.items()
        if listed[0].header_ns == UNSTAMPED and abs(listed[0].log_ns - offsets.get(topic, reference_ns)) < _LATENCY_NS
    )
    return StampClocks(offset_ns, foreign, at_zero)


def _reference(offsets: Mapping[str, int], counts: Mapping[str, int]) -> int:
    """Return log time minus stamp of the clock that most topics share; that of the log itself, if any topic is on it."""
    on_log = [ns for ns in offsets.values() if abs(ns) <= _AGREE_NS]
    if on_log:
        return int(np.median(on_log))
    alike = {
        topic: [other for other in offsets.values() if abs(other - ns) <= _AGREE_NS] for topic, ns in offsets.items()
    }
    most = max(offsets, key=lambda topic: (len(alike[topic]), counts[topic]))
    return int(np.median(alike[most]))
