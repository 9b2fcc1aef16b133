"""How hard a stop is asked for, and what is noted for the journal."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, NamedTuple


class Stop(IntEnum):
    """What is asked of the executor; the largest wins.

    `HOLD`: no positive acceleration; `SERVICE`: to rest by the drive, then the brake; `FULL`: the brake, at once;
    `EMERGENCY`: the same, and latched.
    """

    GO = 0
    HOLD = 1
    SERVICE = 2
    FULL = 3
    EMERGENCY = 4


class Note(NamedTuple):
    """An event for the journal: what, from which state to which, why, and the figures that made it so."""

    event: str
    before: str = ""
    after: str = ""
    cause: str = ""
    values: Mapping[str, Any] = {}


class Notes:
    """Collects notes until somebody takes them; bounded, the oldest are lost."""

    def __init__(self) -> None:
        self._notes: list[Note] = []

    def add(self, event: str, before: str = "", after: str = "", cause: str = "", **values: Any) -> None:
        """Note something."""
        self._notes.append(Note(event, before, after, cause, values))
        del self._notes[:-1000]

    def take(self) -> list[Note]:
        """Return what was noted since the last call."""
        found, self._notes = self._notes, []
        return found
