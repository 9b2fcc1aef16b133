"""The one place that decides the time of a measurement, `stamp_ns`.

It is the header stamp. Where that is zero, or runs backwards within its topic, it is the log time, moved to the clock of the
stamps: one clock holds for the whole log (`StampClocks`). Where the log time runs backwards as well (old CARMEN loggers), the
recorded stamp is kept as the message's identity, in file order. A stamp that leaps ahead of the log time is not taken at its
word until the next ones confirm it. Where the log's own clock was set (`LogClock`), stamps run on as if it had not been.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lhdmap.logs.clock import ClockStep, LogClock
from lhdmap.logs.stamp_clocks import ONE_CLOCK, UNSTAMPED, StampClocks

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
    `shifts`: from which stamp on stamps were moved, and by how much.
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
    offset_ns: int | None = None
    steps_seen: int = 0
    shifts: list[tuple[int, int]] = field(default_factory=list)


class StampKeeper:
    """Decides the stamps of one log, topic by topic, and counts what was odd."""

    def __init__(self, clocks: StampClocks = ONE_CLOCK, log_clock: LogClock | None = None) -> None:
        self.topics: dict[str, TopicStamps] = {}
        self.clocks = clocks
        self.clock = log_clock or LogClock()

    @property
    def steps(self) -> list[ClockStep]:
        """Where the log's clock was set."""
        return self.clock.steps

    def decide(self, topic: str, header_ns: int, log_ns: int, *, has_header: bool = True) -> int:
        """Return the stamp of a message of `topic` with this header stamp (0: none) and log time, nanoseconds."""
        seen = self.topics.get(topic)
        if seen is None:
            seen = self.topics[topic] = self._first_seen(topic)
        steady_ns = log_ns + self.clock.correction_ns
        if not has_header:
            stamp = steady_ns - self.clocks.offset_ns
        elif header_ns == UNSTAMPED and not (seen.count == 0 and topic in self.clocks.begin_at_zero):
            seen.zero += 1
            stamp = steady_ns - self.clocks.offset_ns
        else:
            stamp = _decided(seen, header_ns + self._shift_ns(seen, header_ns, log_ns), steady_ns)
        _remember(seen, stamp, steady_ns)
        return stamp

    def recorded_ns(self, topic: str, stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return stamps (N,) of a topic as they were recorded: without what took steps of clocks out."""
        shifts = self.topics[topic].shifts if topic in self.topics else []
        if not shifts:
            return stamps_ns
        starts, by_ns = np.array(shifts, dtype=np.int64).T
        return stamps_ns - np.concatenate([[0], by_ns])[np.searchsorted(starts, stamps_ns, side="right")]

    def warnings(self) -> list[str]:
        """Return one line for each kind of oddity and topic."""
        start_ns = min((seen.first_ns for seen in self.topics.values()), default=0)
        lines = [step.text(start_ns) for step in self.steps]
        lines += [self.clocks.text(topic) for topic in self.topics if topic in self.clocks.foreign_ns]
        return lines + [line for topic, seen in self.topics.items() for line in _warnings(topic, seen)]

    def _first_seen(self, topic: str) -> TopicStamps:
        seen = TopicStamps()
        foreign_ns = self.clocks.foreign_ns.get(topic, 0)
        if foreign_ns:
            seen.shifts.append((-(2**62), foreign_ns))
        return seen

    def _shift_ns(self, seen: TopicStamps, header_ns: int, log_ns: int) -> int:
        """Return what brings a header stamp to the clock of the log's start; finds out whether it stepped with the log's."""
        before_ns, seen.offset_ns = seen.offset_ns, log_ns - header_ns
        shift_ns = seen.shifts[-1][1] if seen.shifts else 0
        for step in self.steps[seen.steps_seen :]:
            stays_ns = 0 if before_ns is None else abs(seen.offset_ns - before_ns)
            if stays_ns < 0.5 * abs(step.by_ns):
                shift_ns -= step.by_ns
                seen.shifts.append((header_ns + shift_ns, shift_ns))
        seen.steps_seen = len(self.steps)
        return shift_ns


def _decided(seen: TopicStamps, header_ns: int, log_ns: int) -> int:
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
