"""Who writes the log: what was said on the contract's topics, at the time at which it was sent."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lhdmap.logs.writer import LogWriter
from lhdmap.replay.namespace import topic_of
from lhdmap.replay.process import EVERYWHERE, MILLISECOND_NS, TRUTH, Outgoing, Process, Received
from lhdmap.roles import ROLES

RECORDER = "recorder"
_TOPICS = tuple(role.topic for role in ROLES.values())


class Recorder(Process):
    """Writes all that the link has not touched yet; with `truth` the true pose, too."""

    name, period_ns, priority, site = RECORDER, 50 * MILLISECOND_NS, 95, EVERYWHERE
    inbox_size = 100_000

    def __init__(self, writer: LogWriter, *, truth: bool, machines: Sequence[str] = ("",)) -> None:
        """`machines`: namespaces of those whose topics are written."""
        wanted = [topic for topic in _TOPICS if truth or not topic.startswith(TRUTH)]
        self.reads = tuple(topic_of(machine, topic) for machine in machines for topic in wanted)
        self._writer = writer
        self.messages = 0

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterable[Outgoing]:
        """Write what has come."""
        for received in inbox:
            self._writer.write(received.topic, received.message, received.sent_ns)
        self.messages += len(inbox)
        return ()

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Write what is left."""
        self.step(now_ns, inbox)
