"""Dumping as a process: it has the pedals while the executive wants a bucket emptied."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lhdmap.loading.dump import Dump
from lhdmap.machine_sections import Linkage
from lhdmap.messages import Command
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import DUMPING, MACHINE_SAYS, MILLISECOND_NS, ORDERS, PEDALS, Outgoing, Process, Received
from lhdmap.replay.processes.load_feed import SIGNAL_TOPICS, SignalFeed
from lhdmap.replay.processes.told import Digs, DumpingNow
from lhdmap.simulation.history import SECOND_NS

DUMPS = "dumping"
_MOST_NS = 90 * SECOND_NS
_OLD_NS = 300 * MILLISECOND_NS
BUSY, DONE, FAILED = "busy", "done", "failed"


class Dumps(Process):
    """Pedals each 20 ms while a task of dumping runs and the machine is armed; it waits while it is not.

    What it dumps with has a clock that stands while it waits: a joint that rested is not at its stop.
    """

    name, period_ns, latency_ns, priority = DUMPS, 20 * MILLISECOND_NS, 2 * MILLISECOND_NS, 20
    reads = (*SIGNAL_TOPICS, ORDERS, MACHINE_SAYS)

    def __init__(self, scribe: Scribe, linkage: Linkage | None = None) -> None:
        self._dump, self._signals, self._scribe = Dump(linkage), SignalFeed(), scribe
        self._task, self._wanted, self._armed = 0, 0, False
        self._state, self._worked_ns = "", 0

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; work the pedals where a bucket is to be emptied."""
        for received in inbox:
            self._take(received)
        signals = self._signals.signals()
        if signals is None or not self._wanted:
            return
        if self._wanted != self._task:
            self._task, self._state, self._worked_ns = self._wanted, BUSY, 0
            self._dump.begin(signals._replace(now_ns=0))
            self._scribe.goes(BUSY, "ordered", task=self._task)
        if self._state == BUSY:
            fresh = self._armed and now_ns - signals.now_ns <= _OLD_NS
            if self._worked_ns > _MOST_NS:
                self._ends(FAILED, "time limit")
            elif fresh:
                self._worked_ns += self.period_ns
                turn = self._dump.step(signals._replace(now_ns=self._worked_ns))
                p = turn.pedals
                pedals = Command(now_ns, p.propel, 0.0, p.tilt, p.lift, p.full_rpm, p.brake)
                yield Outgoing(PEDALS, Digs(pedals, np.zeros((0, 2))))
                if turn.ended:
                    self._ends(DONE if turn.ended == "dumped" else FAILED, turn.ended)
        yield Outgoing(DUMPING, DumpingNow(now_ns, self._task, self._state))

    def _ends(self, state: str, cause: str) -> None:
        self._state = state
        self._scribe.goes(state, cause)

    def _take(self, received: Received) -> None:
        if received.topic == ORDERS:
            self._wanted = received.message.dumping
        elif received.topic == MACHINE_SAYS:
            self._armed = received.message.armed
        if received.topic in SIGNAL_TOPICS:
            self._signals.take(received)
