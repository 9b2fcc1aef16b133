"""Who judges: sees truth and contacts, says nothing to anybody, and ends the run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lhdmap.messages import Text
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import (
    CONTACT,
    EVERYWHERE,
    MILLISECOND_NS,
    MISSION,
    STATE,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.verdict import Tally

MONITOR = "monitor"


class Monitor(Process):
    """Has the last turn of all at a time."""

    name, period_ns, priority, site = MONITOR, 100 * MILLISECOND_NS, 90, EVERYWHERE
    reads = (STATE, CONTACT, MISSION)

    def __init__(self, tally: Tally, scribe: Scribe) -> None:
        self.tally, self._scribe = tally, scribe

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to wait for."""
        return self.tally.ended

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterable[Outgoing]:
        """Take what has come and judge."""
        before = len(self.tally.contacts)
        for received in inbox:
            if received.topic == STATE:
                self.tally.at(received.message)
            elif received.topic == CONTACT:
                self.tally.near(received.sent_ns, received.message)
            elif isinstance(received.message, Text):
                self.tally.said(received.sent_ns, received.message.text)
        for contact in self.tally.contacts[before:]:
            self._scribe.event("contact", contact["body"], **contact)
        self.tally.judge(now_ns)
        if self.tally.ended:
            self._scribe.goes("ended", self.tally.reason, ok=self.tally.ok)
        return ()
