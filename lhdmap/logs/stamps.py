"""The one place that decides the time of a measurement, `stamp_ns`.

It is the header stamp. Where that is zero, or runs backwards within its topic, it is the log time. Where the log time
runs backwards as well (old CARMEN loggers), the recorded stamp is kept as the message's identity, in file order.
A stamp that leaps ahead of the log time is not taken at its word until the next ones confirm it. Where the log was recorded
anew, on another day, log times are moved to the time of the stamps: the clock must not change within a drive.
"""

from __future__ import annotations

from dataclasses import dataclass

UNSTAMPED = 0
_AHEAD_NS = 10_000_000_000  # more than a message waits for its logger
_CONFIRMED = 3
_OTHER_CLOCK_NS = 60_000_000_000


@dataclass(slots=True)
class TopicStamps:
    """What was seen of the stamps of one topic; counts of messages, times in integer nanoseconds.

    `zero`: header stamps of zero; `backward`: header stamps before the one used last; `log_backward`: those where the
    log time ran backwards too; `duplicate`: those equal to the one used last; `ahead`: those that leapt.
    `first_ns`, `last_ns`: stamps used.
    `offset_min_ns`, `offset_max_ns`: log time minus header stamp.
    """

    count: int = 0
    zero: int = 0
    backward: int = 0
    log_backward: int = 0
    duplicate: int = 0
    ahead: int = 0
    ahead_in_a_row: int = 0
    worst_backward_ns: int = 0
    first_ns: int = 0
    last_ns: int = 0
    last_log_ns: int = 0
    max_gap_ns: int = 0
    max_gap_at_ns: int = 0
    offset_min_ns: int | None = None
    offset_max_ns: int | None = None


class StampKeeper:
    """Decides the stamps of one log, topic by topic, and counts what was odd."""

    def __init__(self) -> None:
        self.topics: dict[str, TopicStamps] = {}

    def decide(self, topic: str, header_ns: int, log_ns: int, *, has_header: bool = True) -> int:
        """Return the stamp of a message of `topic` with this header stamp (0: none) and log time, nanoseconds."""
        seen = self.topics.get(topic)
        if seen is None:
            seen = self.topics[topic] = TopicStamps()
        stamp = _decided(seen, header_ns, log_ns) if has_header else log_ns
        _remember(seen, stamp, log_ns)
        return stamp

    def warnings(self) -> list[str]:
        """Return one line for each topic and kind of odd stamp."""
        return [line for topic, seen in self.topics.items() for line in _warnings(topic, seen)]


def _decided(seen: TopicStamps, header_ns: int, log_ns: int) -> int:
    if header_ns == UNSTAMPED:
        seen.zero += 1
        return log_ns
    if _leaps(seen, header_ns, log_ns):
        return _at_log_time(seen, log_ns)
    offset = log_ns - header_ns
    if seen.offset_min_ns is None or offset < seen.offset_min_ns:
        seen.offset_min_ns = offset
    if seen.offset_max_ns is None or offset > seen.offset_max_ns:
        seen.offset_max_ns = offset
    if not seen.count or header_ns > seen.last_ns:
        return header_ns
    if header_ns == seen.last_ns:
        seen.duplicate += 1
        return header_ns
    seen.backward += 1
    seen.worst_backward_ns = max(seen.worst_backward_ns, seen.last_ns - header_ns)
    if log_ns < seen.last_log_ns:
        seen.log_backward += 1
        return header_ns
    return log_ns if abs(offset) < _OTHER_CLOCK_NS else _at_log_time(seen, log_ns)


def _leaps(seen: TopicStamps, header_ns: int, log_ns: int) -> bool:
    """Return whether a stamp is far ahead of what the log time says, and not yet confirmed by others."""
    ahead = seen.count and header_ns - seen.last_ns - (log_ns - seen.last_log_ns) > _AHEAD_NS
    seen.ahead_in_a_row = seen.ahead_in_a_row + 1 if ahead else 0
    leaps = 0 < seen.ahead_in_a_row <= _CONFIRMED and log_ns >= seen.last_log_ns
    seen.ahead += leaps
    return leaps


def _at_log_time(seen: TopicStamps, log_ns: int) -> int:
    """Return the stamp that the log time tells, on the clock of the stamps so far."""
    return seen.last_ns + log_ns - seen.last_log_ns


def _remember(seen: TopicStamps, stamp_ns: int, log_ns: int) -> None:
    if not seen.count:
        seen.first_ns = stamp_ns
    elif stamp_ns - seen.last_ns > seen.max_gap_ns:
        seen.max_gap_ns, seen.max_gap_at_ns = stamp_ns - seen.last_ns, seen.last_ns
    seen.count += 1
    seen.last_ns, seen.last_log_ns = stamp_ns, log_ns


def _warnings(topic: str, seen: TopicStamps) -> list[str]:
    lines = []
    if seen.zero:
        lines.append(f"{topic}: {seen.zero} of {seen.count} messages have no stamp; their log time is used instead")
    if seen.ahead:
        lines.append(f"{topic}: {seen.ahead} stamps leap ahead; the log time is used for them instead")
    replaced = seen.backward - seen.log_backward
    worst = f"by up to {seen.worst_backward_ns / 1e9:.3f} s"
    if replaced:
        lines.append(f"{topic}: {replaced} stamps run backwards ({worst}); the log time is used for them instead")
    if seen.log_backward:
        lines.append(
            f"{topic}: {seen.log_backward} stamps run backwards ({worst}), as does the log time; kept, in file order"
        )
    return lines
