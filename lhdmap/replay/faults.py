"""When faults begin and end, by time or by place; who has to do with one asks for it here. Sensors have theirs on their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lhdmap.replay.journal import Event, Journal
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.simulation.sensing.faults import FaultSettings
from lhdmap.simulation.sensing.sensor import NEVER_NS

PLACE_M, _LEVEL_M = 3.0, 2.0
"""So near a place a machine is at it; another level is another place."""
_FOLLOWED_S, _MOST_FOLLOWED = 5.0, 10
_OWN = "faults"
Position = tuple[float, float, float]
THINGS = ("obstacle", "person")


class Fault:
    """A fault of a run: when it holds, and what followed it."""

    def __init__(
        self, number: int, settings: FaultSettings, place_m: Position | None, *, scripted: bool = True
    ) -> None:
        self.number, self.settings, self.place_m, self.scripted = number, settings, place_m, scripted
        self.from_ns = START_NS + round(settings.at_s * SECOND_NS)
        self.began_ns: int | None = None
        self.ended_ns: int | None = None
        self.followed: list[dict[str, Any]] = []

    @property
    def waits_for_place(self) -> bool:
        """Whether it begins where the machine comes to a place; a thing stands there, whether it comes or not."""
        return self.place_m is not None and self.settings.kind not in THINGS

    @property
    def known_time(self) -> bool:
        """Whether its time is known from the start on: its sensor has it in itself then."""
        return self.scripted and not self.waits_for_place

    @property
    def until_ns(self) -> int:
        """When it ends, once it has begun."""
        if self.began_ns is None or self.settings.duration_s == 0.0:
            return NEVER_NS
        return self.began_ns + round(self.settings.duration_s * SECOND_NS)

    def told(self) -> dict[str, Any]:
        """Return what the verdict says of it."""
        one = self.settings
        return {
            "kind": one.kind,
            "target": one.target,
            "at": one.at,
            "size": one.size,
            "began_s": None if self.began_ns is None else (self.began_ns - START_NS) / SECOND_NS,
            "ended_s": None if self.ended_ns is None else (self.ended_ns - START_NS) / SECOND_NS,
            "followed": self.followed,
        }


Watcher = Callable[[Fault, bool], None]


class Faults:
    """The faults of a run. `next_ns` is when one begins or ends next; the engine then calls `update`."""

    def __init__(
        self, settings: Sequence[FaultSettings], journal: Journal, places: Mapping[str, Position] | None = None
    ) -> None:
        at = places or {}
        self.all = [Fault(n, one, at.get(one.at)) for n, one in enumerate(settings, start=1)]
        self.active: list[Fault] = []
        self.watchers: list[Watcher] = []
        self._journal = journal
        self._waiting = list(self.all)
        self.next_ns = self._next()
        if self.all:
            journal.listeners.append(self._follow)

    def update(self, now_ns: int) -> None:
        """Begin and end what is due by time."""
        for fault in [one for one in self.active if one.until_ns <= now_ns]:
            self.active.remove(fault)
            fault.ended_ns = now_ns
            self._tell(fault, begins=False)
        for fault in [one for one in self._waiting if one.from_ns <= now_ns and not one.waits_for_place]:
            self._begin(fault, now_ns)
        self.next_ns = self._next()

    def inject(self, settings: FaultSettings, now_ns: int) -> Fault:
        """Begin a fault that no scenario has, at this moment."""
        if not self.all:
            self._journal.listeners.append(self._follow)
        fault = Fault(len(self.all) + 1, settings, None, scripted=False)
        self.all.append(fault)
        self._waiting.append(fault)
        self._begin(fault, now_ns)
        self.next_ns = self._next()
        return fault

    def reached(self, position_m: Position, now_ns: int) -> None:
        """Begin what waits for the place that the machine is at."""
        for fault in [one for one in self._waiting if one.waits_for_place and one.from_ns <= now_ns]:
            if fault.place_m is not None and _near(fault.place_m, position_m):
                self._begin(fault, now_ns)
                self.next_ns = self._next()

    @property
    def waits_for_places(self) -> bool:
        """Whether `reached` has anything to do."""
        return any(fault.waits_for_place for fault in self._waiting)

    def of(self, kind: str, target: str) -> Fault | None:
        """Return the latest active fault of a kind and a target."""
        found = [one for one in self.active if one.settings.kind == kind and one.settings.target == target]
        return found[-1] if found else None

    def _begin(self, fault: Fault, now_ns: int) -> None:
        self._waiting.remove(fault)
        self.active.append(fault)
        fault.began_ns = now_ns
        self._tell(fault, begins=True)

    def _tell(self, fault: Fault, *, begins: bool) -> None:
        one = fault.settings
        values = {"number": fault.number, "kind": one.kind, "target": one.target, "size": one.size}
        self._journal.write(_OWN, "begins" if begins else "ends", cause="scenario", values=values)
        for watcher in self.watchers:
            watcher(fault, begins)

    def _next(self) -> int:
        times = [one.from_ns for one in self._waiting if not one.waits_for_place]
        return min([*times, *(one.until_ns for one in self.active)], default=NEVER_NS)

    def _follow(self, event: Event) -> None:
        """Note what others did while a fault held, and shortly after."""
        if event.process == _OWN:
            return
        for fault in self.all:
            if fault.began_ns is None or len(fault.followed) >= _MOST_FOLLOWED:
                continue
            end_ns = math.inf if fault.ended_ns is None else fault.ended_ns + _FOLLOWED_S * SECOND_NS
            if event.t_ns <= end_ns:
                after_s = (event.t_ns - fault.began_ns) / SECOND_NS
                told = {"after_s": after_s, "process": event.process, "event": event.event}
                fault.followed.append({**told, "to": event.after, "cause": event.cause})


def _near(place_m: Position, position_m: Position) -> bool:
    flat_m = math.hypot(place_m[0] - position_m[0], place_m[1] - position_m[1])
    return flat_m < PLACE_M and abs(place_m[2] - position_m[2]) < _LEVEL_M
