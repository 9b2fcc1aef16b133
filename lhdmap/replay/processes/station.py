"""The scripted operator at the station: sign of life, modes at set times, arming after a stop, and help where it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MACHINE_SAYS, MILLISECOND_NS, STATION, STATION_SAYS, Outgoing, Process, Received
from lhdmap.replay.processes.helping import Help
from lhdmap.replay.processes.told import Health, Word
from lhdmap.replay.scenario import ModeAt
from lhdmap.simulation.history import SECOND_NS, START_NS

_IDLE = "idle"
_FIRST_NS = SECOND_NS


class Station(Process):
    """Sees no truth. `modes`: what is wanted from when on, the first one from the start; `rearm_s`: how long it looks at a stop.

    `assist_s`: how long it takes to answer a request for help; `assists`: how many it answers; `backs_up`: whether it drives then.
    """

    name, period_ns, priority, site = "station", 100 * MILLISECOND_NS, 50, STATION
    reads = (MACHINE_SAYS,)

    def __init__(
        self,
        modes: Sequence[ModeAt],
        rearm_s: float,
        assist_s: float,
        scribe: Scribe,
        assists: int = 5,
        *,
        backs_up: bool = True,
    ) -> None:
        self._modes, self._rearm_ns, self._scribe = list(modes), round(rearm_s * SECOND_NS), scribe
        self._wanted = self._modes.pop(0)
        self._help = Help(assist_s, scribe, assists, backs_up=backs_up)
        self._health: Health | None = None
        self._since_ns: int | None = None
        self._asked_ns = 0
        self._first = True

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Say that it lives, and what it wants."""
        for received in inbox:
            self._health = received.message
        while self._modes and now_ns - START_NS >= self._modes[0].at_s * SECOND_NS:
            self._wanted = self._modes.pop(0)
            self._scribe.event("wants", "scenario", mode=self._wanted.mode, goal=self._wanted.goal)
        yield Outgoing(STATION_SAYS, self._word(now_ns)._replace(gave_up=self._help.gave_up))

    def _word(self, now_ns: int) -> Word:
        health = self._health
        if health is None:
            return Word(now_ns)
        wanted = self._help.wanted(now_ns, health, self._wanted)
        if not health.armed:
            return self._arming(now_ns, health, wanted)
        self._since_ns, self._first = None, False
        if health.mode != wanted.mode:
            return Word(now_ns, mode=wanted.mode)
        speed_mps, rate_rps = wanted.speed_kmh / 3.6, wanted.steering_rps
        drives = wanted.mode in ("assisted", "teleoperated", "manual")
        told = Word(now_ns, speed_mps=speed_mps, steering_rate_rps=rate_rps) if drives else Word(now_ns)
        return told._replace(goal=wanted.goal, go_on=self._help.done)

    def _arming(self, now_ns: int, health: Health, wanted: ModeAt) -> Word:
        """Arm a machine that stands, after a look at it."""
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        wait_ns = _FIRST_NS if self._first else self._rearm_ns
        early = now_ns - self._since_ns < wait_ns or now_ns - self._asked_ns < SECOND_NS
        if wanted.mode == _IDLE or not health.standing or early:
            return Word(now_ns)
        self._asked_ns = now_ns
        self._scribe.event("arms", "; ".join(health.causes), mode=wanted.mode)
        return Word(now_ns, mode=wanted.mode, rearm=True)
