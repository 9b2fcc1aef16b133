"""Simulated time: turns and messages in one fixed order (time, then priority, then name), one thread, no wall clock."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from typing import Any

from lhdmap.replay.bus import Bus, ProcessInbox
from lhdmap.replay.faults import Faults
from lhdmap.replay.journal import Journal
from lhdmap.replay.link import Link
from lhdmap.replay.namespace import role_of
from lhdmap.replay.process import ENGINE, Outgoing, Process, Received
from lhdmap.simulation.history import SECOND_NS, START_NS

_MESSAGE, _TURN = 0, 1  # at the same time messages arrive before anybody has a turn
_OVERRUN_PERIODS = 3
_TOLD_NS = SECOND_NS // 10


class _Slot:
    """A process with what the engine knows of it."""

    def __init__(self, process: Process, inbox: ProcessInbox) -> None:
        self.process, self.inbox = process, inbox
        self.busy_until_ns = 0
        self.missed = 0
        self.all_missed = 0


class Engine:
    """Runs processes. `faults` makes them overrun, `link` loses and delays what they say."""

    def __init__(
        self,
        processes: Sequence[Process],
        journal: Journal,
        *,
        faults: Faults | None = None,
        link: Link | None = None,
        start_ns: int = START_NS,
        withhold_truth: bool = False,
    ) -> None:
        """Raises ValueError where two processes have one name, or one may not see what it reads."""
        names = [process.name for process in processes]
        if len(set(names)) != len(names):
            raise ValueError(f"two processes have one name: {', '.join(sorted(names))}")
        self.now_ns, self.messages = start_ns, 0
        self._journal, self._faults = journal, faults or Faults((), journal)
        self._bus = Bus(processes, link, withhold_truth=withhold_truth)
        self._slots = [_Slot(process, self._bus.inboxes[process.name]) for process in processes]
        self._queue: list[tuple[int, int, int, str, int, Any]] = []
        self._count = 0
        journal.now_ns = start_ns
        for slot in self._slots:
            self._plan(start_ns, slot)

    def run(self, until_ns: int) -> Iterator[int]:
        """Run up to a time, and yield the time ten times a second, when the caller may stop."""
        queue, told_ns = self._queue, self.now_ns
        if self.now_ns >= self._faults.next_ns:
            self._faults.update(self.now_ns)
        while queue and queue[0][0] <= until_ns:
            now_ns, kind, _, _, _, what = heapq.heappop(queue)
            if now_ns != self.now_ns:
                if now_ns - told_ns >= _TOLD_NS:
                    yield self.now_ns
                    told_ns = now_ns
                self.now_ns = self._journal.now_ns = now_ns
                if now_ns >= self._faults.next_ns:
                    self._faults.update(now_ns)
            if kind == _MESSAGE:
                message, inboxes = what
                for inbox in inboxes:
                    inbox.put(message)
            else:
                self._turn(what, now_ns)
        yield self.now_ns

    def finish(self) -> None:
        """Say to all, in the order of their priority, that the run has ended; they get what has come meanwhile."""
        for slot in sorted(self._slots, key=lambda one: (one.process.priority, one.process.name)):
            slot.process.finish(self.now_ns, slot.inbox.take())

    def missed(self) -> dict[str, int]:
        """Return how many turns each process has missed."""
        return {slot.process.name: slot.all_missed for slot in self._slots}

    def _turn(self, slot: _Slot, now_ns: int) -> None:
        process = slot.process
        self._plan(now_ns + process.period_ns, slot)
        if now_ns < slot.busy_until_ns:
            self._miss(slot)
            return
        latency_ns = process.latency_ns
        if self._faults.active:
            latency_ns += self._overrun_ns(process)
        slot.busy_until_ns = now_ns + latency_ns
        if slot.missed:
            self._journal.write(process.name, "on time", cause="turn held", values={"missed": slot.missed})
            slot.missed = 0
        inbox = slot.inbox.take()
        if slot.inbox.lost:
            self._journal.write(process.name, "inbox full", cause="too slow", values={"lost": slot.inbox.told_lost()})
        for outgoing in process.step(now_ns, inbox):
            self._send(process, outgoing, now_ns + latency_ns)

    def _miss(self, slot: _Slot) -> None:
        slot.all_missed += 1
        slot.missed += 1
        if slot.missed == 1:
            busy_s = (slot.busy_until_ns - self.now_ns) / SECOND_NS
            self._journal.write(slot.process.name, "overrun", cause="still busy", values={"busy_s": busy_s})

    def _overrun_ns(self, process: Process) -> int:
        """Return how much longer a turn takes by a fault."""
        fault = self._faults.of("overrun", process.name)
        if fault is None:
            return 0
        return round(fault.settings.size * SECOND_NS) or _OVERRUN_PERIODS * process.period_ns

    def _send(self, process: Process, outgoing: Outgoing, at_ns: int) -> None:
        topic, message, own_ns = outgoing
        sent_ns = at_ns if own_ns is None else max(own_ns, self.now_ns)
        self.messages += 1
        one = Received(topic, sent_ns, message)
        for arrives_ns, inboxes in self._bus.deliveries(process, topic, sent_ns):
            self._count += 1
            heapq.heappush(self._queue, (arrives_ns, _MESSAGE, 0, "", self._count, (one, inboxes)))

    def _plan(self, at_ns: int, slot: _Slot) -> None:
        self._count += 1
        process = slot.process
        heapq.heappush(self._queue, (at_ns, _TURN, process.priority, process.name, self._count, slot))


def overrun_targets(processes: Sequence[Process]) -> list[str]:
    """Return the processes that can be made to overrun: all but the simulator and the witnesses."""
    return [process.name for process in processes if process.site and role_of(process.name) not in (ENGINE, "plant")]
