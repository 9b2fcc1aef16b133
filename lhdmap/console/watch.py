"""The machine's own judgement of its operator's page: alive and near enough, or stop. Time is an input.

The machine sends numbered ticks; the page's main thread answers each. An answer proves that the page lived after its tick was
sent: silence is counted from there, by the machine's own clock. No queue on the way and no other clock can make the page look more
alive.
"""

from __future__ import annotations

from collections import OrderedDict, deque

from lhdmap.console.settings import ConsoleSettings

LEAD_NS = 40_000_000  # two turns of the process that asks, so that the brake is on when the limit has passed
_KEPT = 200  # ticks that may still be answered
_ROW = 5  # round trips above the limit, until they count


class Watch:
    """Counts ticks and answers. All times are of one clock, the machine's."""

    def __init__(self, settings: ConsoleSettings) -> None:
        self._limit_ns = round(settings.heartbeat_limit_s * 1e9) - LEAD_NS
        self._latency_ns = round(settings.latency_limit_s * 1e9)
        self._sent: OrderedDict[int, int] = OrderedDict()
        self._count = 0
        self._alive_ns: int | None = None
        self._trips: deque[int] = deque(maxlen=_ROW)
        self.by = ""

    @property
    def round_trip_s(self) -> float:
        """Time from the last tick that was answered to its answer, s."""
        return self._trips[-1] * 1e-9 if self._trips else 0.0

    @property
    def latency_limit_s(self) -> float:
        """What round trips must not exceed, s."""
        return self._latency_ns / 1e9

    def tick(self, now_ns: int) -> int:
        """Return the number of a tick that is sent now."""
        self._count += 1
        self._sent[self._count] = now_ns
        if len(self._sent) > _KEPT:
            self._sent.popitem(last=False)
        return self._count

    def answered(self, number: int, by: str, now_ns: int) -> bool:
        """Take an answer; False where there was no such tick, or it has been answered."""
        sent_ns = self._sent.pop(number, None)
        if sent_ns is None or sent_ns > now_ns:
            return False
        if by != self.by:
            self.by = by
            self._trips.clear()
        self._trips.append(now_ns - sent_ns)
        self._alive_ns = sent_ns if self._alive_ns is None else max(sent_ns, self._alive_ns)
        return True

    def fault(self, now_ns: int) -> str:
        """Return why the machine must not be driven under this operator; empty: it may."""
        if self._alive_ns is None:
            return "no operator"
        silent_ns = now_ns - self._alive_ns
        if silent_ns >= self._limit_ns:
            return f"operator's page silent for {silent_ns * 1e-9:.2f} s"
        if len(self._trips) == _ROW and min(self._trips) > self._latency_ns:
            return f"round trip to the operator's page {min(self._trips) * 1e-9:.2f} s"
        return ""
