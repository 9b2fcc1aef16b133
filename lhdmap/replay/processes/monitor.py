"""Who judges: sees truth and contacts, says nothing to anybody, and ends the run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from lhdmap.messages import Text
from lhdmap.replay.journal import Scribe
from lhdmap.replay.lane_tally import LaneTally
from lhdmap.replay.load_tally import LoadTally
from lhdmap.replay.process import (
    CONTACT,
    EVERYWHERE,
    LOADING,
    MILLISECOND_NS,
    MISSION,
    STATE,
    WAY,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.verdict import Tally

MONITOR = "monitor"


class Monitor(Process):
    """Has the last turn of all at a time."""

    name, period_ns, priority, site = MONITOR, 100 * MILLISECOND_NS, 90, EVERYWHERE
    reads = (STATE, CONTACT, MISSION, LOADING, WAY)

    def __init__(self, tally: Tally, scribe: Scribe, load: LoadTally | None = None, lane: LaneTally | None = None) -> None:
        self.tally, self._scribe, self.load, self._lane = tally, scribe, load, lane

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to wait for."""
        return self.tally.ended

    def verdict(self) -> dict[str, Any]:
        """Return what is said of the kind alone."""
        counted = {} if self.load is None else self.load.verdict()
        return counted | ({} if self._lane is None else self._lane.verdict())

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterable[Outgoing]:
        """Take what has come and judge."""
        before = len(self.tally.contacts)
        for received in inbox:
            if received.topic == STATE:
                self.tally.at(received.message)
                if self.load is not None:
                    self.load.at(received.message)
                if self._lane is not None and (nearness := self._lane.at(received.message)) is not None:
                    self.tally.near(received.sent_ns, nearness)
            elif received.topic == WAY and self._lane is not None:
                self._lane.way(received.message)
            elif received.topic == LOADING and self.load is not None:
                self.load.said(received.message)
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
