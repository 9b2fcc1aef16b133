"""What the console's settings change, by clocks that are inputs."""

from __future__ import annotations

from typing import Any

from lhdmap.console.alarms import WARNING, Alarms
from lhdmap.console.link import MachineLink
from lhdmap.console.operators import Tries
from lhdmap.console.sessions import Sessions
from lhdmap.console.settings import ConsoleSettings
from lhdmap.console.watch import Watch

_MS = 1_000_000


def operated(settings: ConsoleSettings) -> list[Any]:
    """Return when which page is a fault, how often it is asked, alarms shown, codes looked at, who is logged in."""
    silent = Watch(settings)
    silent.answered(silent.tick(0), "anna", _MS)
    alarms, tries, sessions = Alarms(settings), Tries(settings), Sessions(settings)
    told: list[Any] = [[bool(silent.fault(k * _MS)) for k in range(0, 2000, 10)], _slow_from(settings)]
    told.append(MachineLink("one", "http://127.0.0.1:1", "key", settings)._client.tick_s)
    for k in range(60):
        alarms.raises(f"{k}", WARNING, "one", f"{k}", 30.0 * k)
        told.append((len(alarms.shown(30.0 * k)), alarms.held_back))
    for k in range(200):
        told.append(tries.allowed(float(k)))
        if told[-1]:
            tries.wrong(float(k))
    token = sessions.open("anna", 0.0)
    return [*told, [sessions.name(token, 1800.0 * k) for k in range(60)]]


def _slow_from(settings: ConsoleSettings) -> int:
    """Return from which round trip on (ms) a page is too far away."""
    for trip_ms in range(10, 400, 10):
        watch = Watch(settings)
        for k in range(6):
            watch.answered(watch.tick(k * 100 * _MS), "anna", (k * 100 + trip_ms) * _MS)
        if watch.fault((500 + trip_ms) * _MS).startswith("round trip"):
            return trip_ms
    return 0
