"""A server that serves its backlog: messages that come later and later, in order, and nothing tells so.

Their times are set against the clock. The two clocks need not agree: what counts is by how much a message is later than the
least late one so far.
"""

from __future__ import annotations

import time
from collections.abc import Callable

BACKLOG_S, _FOR_S = 2.0, 1.0


class Backlog:
    """Watches one link; `late_s` of the newest message."""

    def __init__(
        self,
        least_late_ns: int | None = None,
        now_ns: Callable[[], int] = time.time_ns,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Args: `least_late_ns`: of a link before this one to the same sender."""
        self.least_late_ns = least_late_ns
        self._now_ns, self._monotonic_s = now_ns, monotonic_s
        self._since: tuple[float, float] | None = None
        self.late_s = 0.0

    def served_late(self, sent_ns: int) -> bool:
        """Take the time that a message was sent at; return whether it is over 2 s late, and has been for a second.

        A link that catches up (after a hole in the radio) is given time: the lateness must not fall meanwhile.
        """
        behind_ns = self._now_ns() - sent_ns
        if self.least_late_ns is None or behind_ns < self.least_late_ns:
            self.least_late_ns = behind_ns
        self.late_s = (behind_ns - self.least_late_ns) * 1e-9
        now_s = self._monotonic_s()
        if self.late_s < BACKLOG_S:
            self._since = None
        elif self._since is None or self.late_s < self._since[1] - 0.5:
            self._since = now_s, self.late_s
        return self._since is not None and now_s - self._since[0] > _FOR_S
