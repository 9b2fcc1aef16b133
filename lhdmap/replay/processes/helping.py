"""How the scripted operator helps: after some seconds he backs the machine up by hand, and says to go on."""

from __future__ import annotations

from dataclasses import replace

from lhdmap.replay.journal import Scribe
from lhdmap.replay.processes.told import Health
from lhdmap.replay.scenario import ModeAt
from lhdmap.simulation.history import SECOND_NS

_BACK_NS, _BACK_KMH = 8 * SECOND_NS, 2.2
_STILL_NS = 60 * SECOND_NS
_WAITS = "place not known"


class Help:
    """Answers requests one after the other; `done`: what is left is to say that the machine is to go on.

    `backs_up`: where it drives the machine by hand first; on a surface site it only says that the way is clear.
    Who still asks a minute after it was told to go on asks once more. Of more than `most` requests none is answered any more:
    `gave_up` says so.
    """

    def __init__(self, assist_s: float, scribe: Scribe, most: int, *, backs_up: bool = True) -> None:
        self._backs_up = backs_up
        self._assist_ns, self._scribe = round(assist_s * SECOND_NS), scribe
        self._asked_ns: int | None = None
        self._backs_until_ns: int | None = None
        self._left, self.gave_up = most, ""
        self.done = False

    def wanted(self, now_ns: int, health: Health, script: ModeAt) -> ModeAt:
        """Return the mode that helps now, else that of the script."""
        if not health.asks:
            self._asked_ns, self._backs_until_ns, self.done = None, None, False
            return script
        if self._asked_ns is None or (self.done and now_ns - self._asked_ns > _STILL_NS + self._assist_ns):
            self._asked_ns, self._left = now_ns, self._left - 1
            self._backs_until_ns, self.done = None, False
        if self._left < 0:
            return self._give_up(health.asks)
        if now_ns - self._asked_ns < self._assist_ns:
            return script
        if (
            not self._backs_up
            or _WAITS in health.asks
            or (self._backs_until_ns is not None and now_ns > self._backs_until_ns)
        ):
            self._say("go on", health.asks)
            self.done = True
            return script
        by_hand = replace(script, mode="teleoperated", speed_kmh=-health.gear * _BACK_KMH, steering_dps=0.0, goal="")
        if health.armed and health.mode == by_hand.mode and self._backs_until_ns is None:
            self._backs_until_ns = now_ns + _BACK_NS
            self._scribe.event("helps", health.asks, by="backing up")
        return by_hand

    def _give_up(self, asks: str) -> ModeAt:
        if not self.gave_up:
            self.gave_up = f"the station gave up: {asks}"
            self._scribe.event("gives up", asks)
        return ModeAt(mode="idle")

    def _say(self, what: str, why: str) -> None:
        if not self.done:
            self._scribe.event("helps", why, by=what)
