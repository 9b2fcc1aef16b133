"""The health of the stamps of one topic: gaps, stamps that are zero, twice the same or running backwards, offsets."""

from __future__ import annotations

import heapq

import numpy as np

from lhdmap.logs.doctor.finding import LogFinding, Severity
from lhdmap.logs.stamps import TopicStamps

_SAMPLES = 4096
_LEFT_OUT, _LEFT_OUT_SHARE = 3, 0.02  # of the longest steps: pauses, and clocks that were set
_LONGEST = 50
_GAP_PERIODS, _GAP_LEAST_S = 4.0, 0.3
_OFFSET_S, _OFFSET_SPREAD_S = 1.0, 0.5


class StampWatch:
    """Gathers the times between the messages of one topic in constant memory."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._last_ns: int | None = None
        self._steps: list[int] = []
        self._stride, self.count = 1, 0
        self._longest: list[tuple[int, int]] = []

    def update(self, stamp_ns: int) -> None:
        """Take in the stamp of one message."""
        last, self._last_ns = self._last_ns, stamp_ns
        if last is None:
            return
        step = stamp_ns - last
        if self.count % self._stride == 0:
            self._steps.append(step)
            if len(self._steps) >= _SAMPLES:
                self._steps, self._stride = self._steps[::2], 2 * self._stride
        self.count += 1
        if len(self._longest) < _LONGEST:
            heapq.heappush(self._longest, (step, last))
        elif step > self._longest[0][0]:
            heapq.heapreplace(self._longest, (step, last))

    @property
    def period_s(self) -> float | None:
        """The usual time between messages (the median), None for less than three."""
        return float(np.median(self._steps)) / 1e9 if len(self._steps) > 1 else None

    def findings(self, seen: TopicStamps, start_ns: int) -> list[LogFinding]:
        """Return what is to be said; `start_ns`: where the log begins."""
        return [*self._gaps(start_ns), *self._order(seen), *self._offset(seen)]

    def _mean_s(self) -> float:
        """Return the mean time between messages without the longest ones."""
        kept = len(self._steps) - max(_LEFT_OUT, int(_LEFT_OUT_SHARE * len(self._steps)))
        return float(np.mean(np.sort(self._steps)[:kept])) / 1e9 if kept > 0 else 0.0

    def _gaps(self, start_ns: int) -> list[LogFinding]:
        period_s = self.period_s
        if not period_s or period_s <= 0:
            return []
        usual_s = max(period_s, self._mean_s())  # the mean counts where messages come in bursts
        limit_ns = max(_GAP_PERIODS * usual_s, _GAP_LEAST_S) * 1e9
        gaps = [(step, at) for step, at in self._longest if step > limit_ns]
        if not gaps:
            return []
        step, at = max(gaps)
        many = f"{len(gaps)}{' or more' if len(gaps) == _LONGEST else ''} gap{'s' if len(gaps) > 1 else ''}"
        text = f"{many}, the longest {step / 1e9:.2f} s, {(at - start_ns) / 1e9:.1f} s after the start"
        severity = Severity.PROBLEM if step > 20 * limit_ns else Severity.REMARK
        return [
            LogFinding(
                severity, self.topic, f"{text} (usually {usual_s:.3f} s)", "motion is bridged by prediction there"
            )
        ]

    def _order(self, seen: TopicStamps) -> list[LogFinding]:
        found = []
        if seen.zero:
            found.append(self._unstamped(seen))
        if seen.ahead:
            text = f"{seen.ahead} stamps leap ahead of the log time"
            found.append(LogFinding(Severity.REMARK, self.topic, text, "the log time is used for them"))
        if seen.backward:
            text = f"{seen.backward} stamps run backwards, by up to {seen.worst_backward_ns / 1e9:.3f} s"
            advice = "the log time is used for them"
            if seen.log_backward:
                text += " (the log time does too)"
                advice = "the order of the file is kept, and stamps are taken as names, not as times"
            found.append(LogFinding(Severity.REMARK, self.topic, text, advice))
        if seen.duplicate:
            text = f"{seen.duplicate} of {seen.count} messages have the stamp of the one before"
            severity = Severity.PROBLEM if seen.duplicate > 0.5 * seen.count else Severity.REMARK
            found.append(LogFinding(severity, self.topic, text, "no speed can be had between them"))
        return found

    def _unstamped(self, seen: TopicStamps) -> LogFinding:
        text = f"{seen.zero} of {seen.count} messages have no stamp"
        if seen.last_ns > seen.first_ns:
            return LogFinding(Severity.REMARK, self.topic, text, "the log time is used for them")
        advice = "there is no odometry without times: only a map from given poses is possible"
        return LogFinding(Severity.PROBLEM, self.topic, f"{text}, and the log has no times", advice)

    def _offset(self, seen: TopicStamps) -> list[LogFinding]:
        if seen.offset_min_ns is None or seen.offset_max_ns is None:
            return []
        low, high = seen.offset_min_ns / 1e9, seen.offset_max_ns / 1e9
        if max(abs(low), abs(high)) > _OFFSET_S:
            text = f"log time minus header stamp is {low:.3f} to {high:.3f} s: two clocks, or a re-recorded log"
            return [LogFinding(Severity.REMARK, self.topic, text, "header stamps are used")]
        if high - low > _OFFSET_SPREAD_S:
            text = f"messages were logged {low:.3f} to {high:.3f} s after their header stamp"
            return [LogFinding(Severity.REMARK, self.topic, text, "header stamps are used")]
        return []
