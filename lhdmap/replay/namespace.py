"""Machines of a crew: the first has the contract's topics, the others theirs under `/lhd2/`, `/lhd3/`, as their processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from lhdmap.replay.journal import Event, Journal, Listener, Scribe
from lhdmap.replay.process import TRUTH, Outgoing, Process, Received


class Scribes(Protocol):
    """What gives processes what they write with: a journal, or a part of it."""

    def of(self, process: str) -> Scribe:
        """Return what a process writes with."""
        ...

    def listen(self, listener: Listener) -> None:
        """Tell a listener of each event from now on."""
        ...


class JournalOf:
    """A journal as the processes of one machine see it: their lines carry its name."""

    def __init__(self, journal: Journal, machine: str) -> None:
        self._journal, self._machine = journal, machine

    def of(self, process: str) -> Scribe:
        """Return what a process of the machine writes with."""
        return self._journal.of(f"{self._machine}/{process}")

    def listen(self, listener: Listener) -> None:
        """Tell a listener of the machine's own events, as if it were alone."""
        prefix = f"{self._machine}/"

        def own(event: Event) -> None:
            if event.process.startswith(prefix):
                listener(event._replace(process=event.process.removeprefix(prefix)))

        self._journal.listen(own)


class InNamespace(Process):
    """A process of a machine with a namespace: it reads and says what it would alone, on topics of its machine."""

    def __init__(self, inner: Process, machine: str) -> None:
        self.inner, self._machine = inner, machine
        self.name, self.site = f"{machine}/{inner.name}", inner.site
        self.period_ns, self.latency_ns, self.priority = inner.period_ns, inner.latency_ns, inner.priority
        self.inbox_size = inner.inbox_size
        self._own = {topic_of(machine, topic): topic for topic in inner.reads}
        self.reads = tuple(self._own)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Have a turn."""
        for one in self.inner.step(now_ns, self._inside(inbox)):
            yield one._replace(topic=topic_of(self._machine, one.topic))

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take what has come after the last turn."""
        self.inner.finish(now_ns, self._inside(inbox))

    def _inside(self, inbox: Sequence[Received]) -> list[Received]:
        return [one._replace(topic=self._own[one.topic]) for one in inbox]


def topic_of(machine: str, topic: str) -> str:
    """Return a topic of a machine: `/lhd2/lidar/front/scan`; of the truth `/ground_truth/lhd2/state`; no machine: the topic."""
    if not machine:
        return topic
    return f"{TRUTH}{machine}/{topic[len(TRUTH) :]}" if topic.startswith(TRUTH) else f"/{machine}{topic}"


def machine_of(process: str) -> str:
    """Return the machine of a process by its name; empty: the first one."""
    return process.rpartition("/")[0]


def role_of(process: str) -> str:
    """Return what a process is, whatever its machine."""
    return process.rpartition("/")[2]


def only(machine: str, listener: Callable[[Event], None]) -> Listener:
    """Return a listener that is told of one machine's events alone, as if it were the only one."""

    def listen(event: Event) -> None:
        if machine_of(event.process) == machine:
            listener(event._replace(process=role_of(event.process)))

    return listen
