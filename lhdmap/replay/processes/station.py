"""The scripted operator at the station: sign of life, mode, and arming again some seconds after a stop, when it stands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MACHINE_SAYS, MILLISECOND_NS, STATION, STATION_SAYS, Outgoing, Process, Received
from lhdmap.replay.processes.told import Health, Word

_SECOND_NS = 1_000_000_000


class Station(Process):
    """Wants one mode. `rearm_s`: how long it looks at a machine that has stopped before it arms it; it sees no truth."""

    name, period_ns, priority, site = "station", 100 * MILLISECOND_NS, 50, STATION
    reads = (MACHINE_SAYS,)

    def __init__(self, mode: str, rearm_s: float, scribe: Scribe) -> None:
        self._mode, self._rearm_ns, self._scribe = mode, round(rearm_s * _SECOND_NS), scribe
        self._health: Health | None = None
        self._since_ns: int | None = None
        self._asked_ns = 0
        self._first = True

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Say that it lives, and what it wants."""
        for received in inbox:
            self._health = received.message
        yield Outgoing(STATION_SAYS, self._word(now_ns))

    def _word(self, now_ns: int) -> Word:
        health = self._health
        if health is None or (health.armed and health.mode == self._mode):
            self._since_ns = None
            self._first = self._first and health is None
            return Word(now_ns)
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        wait_ns = _SECOND_NS if self._first else self._rearm_ns
        if not health.standing or now_ns - self._since_ns < wait_ns or now_ns - self._asked_ns < _SECOND_NS:
            return Word(now_ns)
        self._asked_ns = now_ns
        self._scribe.event("arms", "; ".join(health.causes), mode=self._mode)
        return Word(now_ns, mode=self._mode, rearm=True)
