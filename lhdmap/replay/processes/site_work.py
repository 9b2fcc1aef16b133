"""Loading and dumping on a surface site as timed tasks: somebody else has the shovel, and says how much there is in the body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MILLISECOND_NS, ORDERS, WORK, Outgoing, Process, Received
from lhdmap.replay.processes.told import Orders, WorkNow
from lhdmap.simulation.history import SECOND_NS

SITE_WORK = "work"
BUSY, DONE = "busy", "done"
_MORE_S = 1.0  # than it takes: the machine's dead time


class SiteWork(Process):
    """A task lasts its time from when it is ordered."""

    name, period_ns, latency_ns, priority = SITE_WORK, 100 * MILLISECOND_NS, 2 * MILLISECOND_NS, 25
    reads = (ORDERS,)

    def __init__(self, load_s: float, dump_s: float, full_t: float, scribe: Scribe) -> None:
        self._load_s, self._dump_s, self._full_t, self._scribe = load_s, dump_s, full_t, scribe
        self._orders = Orders(0, 0, "", loaded=False)
        self._task, self._state, self._until_ns = 0, "", 0

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Begin what is ordered, say when it is done."""
        for received in inbox:
            self._orders = received.message
        orders = self._orders
        task, loads = orders.loading or orders.dumping, orders.loading > 0
        if task and task != self._task:
            self._task, self._state = task, BUSY
            takes_s = (self._load_s if loads else self._dump_s) + _MORE_S
            self._until_ns = now_ns + round(takes_s * SECOND_NS)
            self._scribe.goes("loads" if loads else "dumps", "ordered", task=task)
        if self._state == BUSY and now_ns >= self._until_ns:
            self._state = DONE
            self._scribe.goes(DONE, "time", task=self._task)
        if task:
            yield Outgoing(WORK, WorkNow(now_ns, self._task, self._state, self._full_t if loads else 0.0))
