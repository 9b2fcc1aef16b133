"""What was counted of a live stream: messages, drops, gaps, reconnects; bounded, however long it runs."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

_FEWEST, _REGULAR_NS = 20, 500_000_000  # a topic that comes less often than twice a second has no period to speak of
_GAP_NS, _GAP_PERIODS = 500_000_000, 5
_LEARNS = 0.05  # share of a new interval in the period


@dataclass(slots=True)
class _Period:
    count: int = 0
    last_ns: int = 0
    mean_ns: float = math.inf


@dataclass(slots=True)
class MessageTally:
    """Counts by topic; `gaps`: pauses of a regular topic of over five of its periods, half a second at least.

    `dropped`: came, and found the queue full; `missed`: counted by the sender, never came; `backlog`: given up by a new
    connection because they were served too late (how many is not known, so the number of times is).
    """

    messages: int = 0
    bytes: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    missed: Counter[str] = field(default_factory=Counter)
    gaps: int = 0
    longest_gap_s: float = 0.0
    reconnects: int = 0
    backlogs: int = 0
    _periods: dict[str, _Period] = field(default_factory=dict)

    def count(self, topic: str, time_ns: int, size: int) -> float | None:
        """Count a message; return the length of the pause before it (s) where that was a gap."""
        self.messages += 1
        self.bytes += size
        seen = self._periods.setdefault(topic, _Period())
        step_ns, seen.last_ns = time_ns - seen.last_ns, time_ns
        seen.count += 1
        if seen.count == 1 or step_ns <= 0:
            return None
        regular = seen.count > _FEWEST and seen.mean_ns < _REGULAR_NS
        if regular and step_ns > max(_GAP_NS, _GAP_PERIODS * seen.mean_ns):
            self.gaps += 1
            self.longest_gap_s = max(self.longest_gap_s, step_ns * 1e-9)
            return step_ns * 1e-9
        seen.mean_ns = step_ns if math.isinf(seen.mean_ns) else seen.mean_ns + _LEARNS * (step_ns - seen.mean_ns)
        return None
