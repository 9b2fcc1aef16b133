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

    def __init__(
        self, tally: Tally, scribe: Scribe, load: LoadTally | None = None, lane: LaneTally | None = None
    ) -> None:
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
        before = len(self.tally.touched.contacts)
        for received in inbox:
            self._take(received)
        for contact in self.tally.touched.contacts[before:]:
            self._scribe.event("contact", contact["body"], **contact)
        self.tally.judge(now_ns)
        if self.tally.ended:
            self._scribe.goes("ended", self.tally.reason, ok=self.tally.ok)
        return ()

    def _take(self, received: Received) -> None:
        topic, sent_ns, message = received
        if topic == STATE:
            self.tally.at(message)
            if self.load is not None:
                self.load.at(message)
            nearness = None if self._lane is None else self._lane.at(message)
            if nearness is not None:
                self.tally.near(sent_ns, nearness)
        elif topic == WAY and self._lane is not None:
            self._lane.way(message)
        elif topic == LOADING and self.load is not None:
            self.load.said(message)
        elif topic == CONTACT:
            self.tally.near(sent_ns, message)
        elif isinstance(message, Text):
            self.tally.said(sent_ns, message.text)
