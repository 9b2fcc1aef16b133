"""The clock that a log was recorded with: where it was set, back or forward, while the recording went on.

Stamps and log times then step alike. Behind a step back, log times run once more through what is there already; behind a step
forward, a pause seems to lie that scan rate and walls contradict. Both are taken out, so that stages see one clock that runs
on; `StampKeeper.recorded_ns` gives the stamps as they were written.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from lhdmap.logs.clock_evidence import ScanMemory
from lhdmap.messages import LaserScan, Message, PointCloud

_BACK_NS = 50_000_000  # log times that fall by less are those of a recorder with several threads
_AHEAD_NS, _AHEAD_SCANS = 400_000_000, 4
_HELD_NS, _HELD = 1_000_000_000, 5000  # what is looked at behind a step at most, to tell what it was
_TIMES_KEPT = 12
_FEWEST_TIMES = 4


class Timed(NamedTuple):
    """A message of a topic with its log time; `stamped`: whether it has a header stamp of its own."""

    topic: str
    log_time_ns: int
    message: Message
    stamped: bool


class ClockStep(NamedTuple):
    """The clock was set by `by_ns` (negative: back) when it should have shown `at_ns`, on the clock of the log's start."""

    at_ns: int
    by_ns: int

    def text(self, start_ns: int) -> str:
        """Return what happened, in words."""
        after_s = (self.at_ns - start_ns) / 1e9
        if self.by_ns < 0:
            return f"the clock was set back by {-self.by_ns / 1e9:.2f} s, {after_s:.1f} s after the start (stamps and log times)"
        return (
            f"the clock was set forward by {self.by_ns / 1e9:.2f} s, {after_s:.1f} s after the start: "
            "scans and walls say that no time passed"
        )


class LogClock:
    """Follows the log times in the order of the file; `correction_ns` brings them to the clock of the log's start."""

    def __init__(self) -> None:
        self.steps: list[ClockStep] = []
        self.correction_ns = 0
        self._last_ns: int | None = None
        self._times: dict[str, deque[int]] = {}
        self._scans: dict[str, ScanMemory] = {}

    def steady(self, stream: Iterable[Timed]) -> Iterator[Timed]:
        """Yield the messages as they come; `correction_ns` is that of the message just yielded."""
        waiting = iter(stream)
        for one in waiting:
            if self._last_ns is None or -_BACK_NS < one.log_time_ns - self._last_ns < _AHEAD_NS:
                self._remember(one)
                yield one
                continue
            held = self._held(one, waiting)
            self._judge(held)
            for behind in held:
                self._remember(behind)
                yield behind

    def _remember(self, one: Timed) -> None:
        self._last_ns = one.log_time_ns
        times = self._times.get(one.topic)
        if times is None:
            times = self._times[one.topic] = deque(maxlen=_TIMES_KEPT)
        times.append(one.log_time_ns)
        if isinstance(one.message, LaserScan):
            self._scans.setdefault(one.topic, ScanMemory()).add(one.message.ranges_m)

    def _held(self, first: Timed, waiting: Iterator[Timed]) -> list[Timed]:
        """Return the messages behind a possible step, up to the first one of each scanner."""
        held, awaited = [first], {topic for topic, memory in self._scans.items() if len(memory)}
        awaited.discard(first.topic)
        while awaited and len(held) < _HELD and abs(held[-1].log_time_ns - first.log_time_ns) < _HELD_NS:
            one = next(waiting, None)
            if one is None:
                break
            held.append(one)
            awaited.discard(one.topic)
        return held

    def _judge(self, held: list[Timed]) -> None:
        """Take out a step, if it is one."""
        assert self._last_ns is not None  # noqa: S101  # something came before
        first = held[0]
        if first.log_time_ns > self._last_ns and not self._no_time_passed(held):
            return
        by_ns = self._step_ns(held)
        at_ns = first.log_time_ns + self.correction_ns - by_ns
        self.steps.append(ClockStep(at_ns, by_ns))
        self.correction_ns -= by_ns

    def _no_time_passed(self, held: list[Timed]) -> bool:
        """Return whether the first scan behind a pause goes on where the last one before it was, though the machine moves."""
        for one in held:
            period_ns = self._period_ns(one.topic)
            if isinstance(one.message, LaserScan) and period_ns and one.topic in self._scans:
                scans = (one.log_time_ns - self._times[one.topic][-1]) / period_ns
                if scans > _AHEAD_SCANS and self._scans[one.topic].goes_on_with(one.message.ranges_m, round(scans)):
                    return True
        return False

    def _step_ns(self, held: list[Timed]) -> int:
        """Return by how much the clock was set: a message comes a period after the one before it, and nothing before its time.

        A scanner's messages tell it, where there is one.
        """
        assert self._last_ns is not None  # noqa: S101
        most_ns = held[0].log_time_ns - self._last_ns
        known = [one for one in held if self._period_ns(one.topic)]
        scans = [one for one in known if isinstance(one.message, (LaserScan, PointCloud))]
        by_period = [
            one.log_time_ns - self._times[one.topic][-1] - (self._period_ns(one.topic) or 0) for one in (scans or known)
        ]
        return min([most_ns, *by_period[:1]])

    def _period_ns(self, topic: str) -> int | None:
        """Return the usual time between messages of a topic, None where too few came."""
        times = self._times.get(topic, ())
        return int(np.median(np.diff(times))) if len(times) >= _FEWEST_TIMES else None
