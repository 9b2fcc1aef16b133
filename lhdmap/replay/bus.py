"""The bus: who gets which topic. Truth goes to the simulator, the operator and the witnesses alone, by their names."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from lhdmap.replay.link import Link
from lhdmap.replay.namespace import role_of
from lhdmap.replay.process import EVERYTHING, TRUTH, Process, Received

SEES_TRUTH = ("plant", "operator", "monitor", "recorder", "film")
"""The simulator, the scripted operator, and those who only watch: nobody else may subscribe to the truth."""


class ProcessInbox:
    """What waits for a process: bounded, the oldest are lost first and counted."""

    def __init__(self, process: Process) -> None:
        self.process, self.lost = process, 0
        self._waiting: deque[Received] = deque(maxlen=process.inbox_size)
        self._full = process.inbox_size

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, message: Received) -> None:
        """Take a message."""
        if len(self._waiting) == self._full:
            self.lost += 1
        self._waiting.append(message)

    def take(self) -> list[Received]:
        """Return all that waits, in the order in which it came."""
        if not self._waiting:
            return []
        found = list(self._waiting)
        self._waiting.clear()
        return found

    def told_lost(self) -> int:
        """Return how many were lost since the last call."""
        lost, self.lost = self.lost, 0
        return lost


class Bus:
    """Routes by topic; which inboxes get a topic is found once."""

    def __init__(self, processes: Sequence[Process], link: Link | None, *, withhold_truth: bool = False) -> None:
        """`withhold_truth`: nobody gets it, to prove that nobody who should not have it needs it.

        Raises:
            ValueError: a process subscribes to the truth that may not see it.
        """
        self._link, self._withhold = link, withhold_truth
        self.inboxes = {process.name: ProcessInbox(process) for process in processes}
        self._routes: dict[str, list[ProcessInbox]] = {}
        self._parted: dict[tuple[str, str, bool], tuple[list[tuple[ProcessInbox, bool]], list[ProcessInbox]]] = {}
        for process in processes:
            secret = [topic for topic in process.reads if topic.startswith(TRUTH)]
            if secret and role_of(process.name) not in SEES_TRUTH:
                raise ValueError(f"process '{process.name}' may not see {secret[0]}: only {', '.join(SEES_TRUTH)}")

    def deliveries(self, sender: Process, topic: str, sent_ns: int) -> Iterator[tuple[int, list[ProcessInbox]]]:
        """Yield when a message arrives, and at whom."""
        route = self._routes.get(topic)
        if route is None:
            route = self._routes[topic] = self._route(topic)
        if not route:
            return
        link = self._link
        if link is None or topic.startswith(TRUTH):
            yield sent_ns, route
            return
        key = sender.site, topic, link.at_fault
        parted = self._parted.get(key)
        if parted is None:
            parted = self._parted[key] = _parted(sender.site, route, at_fault=link.at_fault)
        over, at_once = parted
        for inbox, crosses in over:
            at_ns = link.arrival_ns(topic, inbox.process.name, sent_ns, crosses=crosses)
            if at_ns is not None:
                yield at_ns, [inbox]
        if at_once:
            yield sent_ns, at_once

    def _route(self, topic: str) -> list[ProcessInbox]:
        if topic.startswith(TRUTH) and self._withhold:
            return []
        return [inbox for inbox in self.inboxes.values() if _gets(inbox.process, topic)]


def _parted(
    here: str, route: list[ProcessInbox], *, at_fault: bool
) -> tuple[list[tuple[ProcessInbox, bool]], list[ProcessInbox]]:
    """Return the inboxes that the link decides on, and whether it lies between; and those that get all at once."""
    over: list[tuple[ProcessInbox, bool]] = []
    at_once: list[ProcessInbox] = []
    for inbox in route:
        crosses = bool(here and inbox.process.site and here != inbox.process.site)
        if not crosses and (not at_fault or not inbox.process.site):
            at_once.append(inbox)
        else:
            over.append((inbox, crosses))
    return over, at_once


def _gets(process: Process, topic: str) -> bool:
    if topic.startswith(TRUTH) and role_of(process.name) not in SEES_TRUTH:
        return False
    return topic in process.reads or EVERYTHING in process.reads
