"""What an operator must see: ranked, each once, no more than he can manage. Time is an input."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from lhdmap.console.settings import ConsoleSettings

STOPPED, ASKS, WARNING = 1, 2, 3
"""Ranks: a machine has stopped or is lost; it asks for help; something is worth a look."""


class Alarm(NamedTuple):
    """An alarm: rank, machine, what, since when, how often. Those of rank 1 and 2 are states: shown as long as they last."""

    rank: int
    machine: str
    text: str
    since_s: float
    times: int = 1


class Alarms:
    """`shown`: by rank, then the newest first; `held_back`: how many warnings there were no places for."""

    def __init__(self, settings: ConsoleSettings) -> None:
        self._most, self._window_s = settings.alarms_most, settings.alarms_window_s
        self._alarms: dict[tuple[str, str], Alarm] = {}
        self._new: deque[float] = deque()
        self.held_back = 0

    def raises(self, key: str, rank: int, machine: str, text: str, now_s: float) -> None:
        """Raise an alarm; the same one again is counted."""
        name = machine, key
        known = self._alarms.get(name)
        if known is not None:
            self._alarms[name] = known._replace(times=known.times + (rank == WARNING), text=text)
            return
        self._forget(now_s)
        if rank == WARNING:
            if len(self._new) >= self._most:
                self.held_back += 1
                return
            self._new.append(now_s)
        self._alarms[name] = Alarm(rank, machine, text, now_s)

    def clear(self, key: str, machine: str) -> None:
        """Take back an alarm whose reason is gone."""
        self._alarms.pop((machine, key), None)

    def shown(self, now_s: float) -> list[Alarm]:
        """Return the alarms of now."""
        self._forget(now_s)
        return sorted(self._alarms.values(), key=lambda alarm: (alarm.rank, -alarm.since_s))

    def _forget(self, now_s: float) -> None:
        """Let go of what is over: a window's count, and warnings that are older."""
        while self._new and now_s - self._new[0] >= self._window_s:
            self._new.popleft()
            self.held_back = 0
        for name, alarm in list(self._alarms.items()):
            if alarm.rank == WARNING and now_s - alarm.since_s >= self._window_s:
                del self._alarms[name]
