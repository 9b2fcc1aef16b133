"""Section control: who may drive into which section next. Pure: time is an input, grants are the output.

A machine holds the section that it is in, and the one behind it until its rear has left it. What it wants next is granted where
that is free and the state after it is safe (`lhdmap.traffic.claims`); who has waited longest is asked first. Who has waited longer
than `PATIENCE_S` stops new cycles of all others: they come home, and from there its own can always be driven.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lhdmap.errors import UsageError
from lhdmap.traffic.claims import Claims, Joint
from lhdmap.traffic.sections import Cycle, Haul, Leg, Place, SectionMap


class _Wait(NamedTuple):
    """What a machine waits for: since when, for which section (empty: any), whether it is bound for home."""

    since_ns: int
    section: str
    home: bool


class Grant(NamedTuple):
    """A machine may drive into a section, and is on this leg then."""

    machine: str
    section: str
    leg: Leg


PATIENCE_S = 90.0
_FREE = (Leg.EMPTY, Leg.HOME)


class TrafficControl:
    """Controls machines on one map; each begins at its home.

    Raises:
        UsageError: a machine that is at home is always in the way of another.
    """

    def __init__(self, sections: SectionMap, hauls: Mapping[str, Haul]) -> None:
        self.names = list(hauls)
        self.claims = Claims([Cycle(sections, haul) for haul in hauls.values()])
        self._at: Joint = self.claims.home
        self._behind: dict[str, str] = {}
        self._waits: dict[str, _Wait] = {}
        for who, name in enumerate(self.names):
            if not self.claims.can_dump_alone(who):
                raise UsageError(f"machine '{name}' can never dump: another one that is at home is in its way")

    def place(self, machine: str) -> Place:
        """Return what a machine is at: the section that was granted last."""
        who = self.names.index(machine)
        return self.claims.cycles[who].places[self._at[who]]

    def haul(self, machine: str) -> Haul:
        """Return what a machine does."""
        return self.claims.cycles[self.names.index(machine)].haul

    def held(self) -> dict[str, str]:
        """Return who holds each section that is held."""
        front = {self.place(name).section: name for name in self.names}
        return {section: name for name, section in self._behind.items()} | front

    def behind(self, machine: str) -> str:
        """Return the section that a machine holds behind the one that was granted last; empty: none."""
        return self._behind.get(machine, "")

    def wants(self, machine: str, now_ns: int, section: str = "", *, home: bool = False) -> None:
        """A machine asks to go on: wherever its way leads, or into one section alone; `home`: it has nothing more to load."""
        since = self._waits[machine].since_ns if machine in self._waits else now_ns
        self._waits[machine] = _Wait(since, section, home)

    def left(self, machine: str) -> None:
        """The rear of a machine has left the section behind it."""
        self._behind.pop(machine, None)

    def waiting(self) -> dict[str, int]:
        """Return who waits, and since when."""
        return {name: wait.since_ns for name, wait in self._waits.items()}

    def step(self, now_ns: int) -> list[Grant]:
        """Return what is granted now, in order; a machine that got something asks anew for what follows."""
        given: list[Grant] = []
        while (grant := self._next(now_ns)) is not None:
            given.append(grant)
        return given

    def _next(self, now_ns: int) -> Grant | None:
        line = sorted(self._waits, key=lambda name: (self._waits[name].since_ns, self.names.index(name)))
        starved = line and now_ns - self._waits[line[0]].since_ns > PATIENCE_S * 1e9
        return (starved and self._first(line, new_cycles=line[:1])) or self._first(line, new_cycles=line) or None

    def _first(self, line: Sequence[str], new_cycles: Sequence[str]) -> Grant | None:
        """Return the first grant along a line of machines; those in `new_cycles` may begin another cycle."""
        held = self.held()
        for name in line:
            who, here = self.names.index(name), self.place(name)
            for following in self._options(who, self._waits[name]):
                after = (*self._at[:who], following, *self._at[who + 1 :])
                place = self.claims.cycles[who].places[following]
                if self._behind.get(name, place.section) != place.section:
                    continue  # its rear is still in the section behind: a third one is not held
                if here.leg == Leg.HOME and place.leg != Leg.HOME and name not in new_cycles:
                    continue
                if held.get(place.section, name) == name and self.claims.safe(after):
                    self._behind[name] = here.section
                    self._at = after
                    del self._waits[name]
                    return Grant(name, place.section, place.leg)
        return None

    def _options(self, who: int, wait: _Wait) -> Sequence[int]:
        """Return the states that a machine may go to, the best first; home only where that is wanted, or nothing else is safe."""
        cycle = self.claims.cycles[who]
        options, place = list(cycle.moves[self._at[who]]), cycle.places[self._at[who]]
        if place.leg != Leg.LOADED:  # it may think better of its next bucket, and of going home
            options += [k for other in _FREE if other != place.leg for k in cycle.moves_of(Place(other, place.section))]
        options = [k for k in dict.fromkeys(options) if wait.section in ("", cycle.places[k].section)]
        if place.leg == Leg.LOADED:
            return options
        home = [k for k in options if cycle.places[k].leg == Leg.HOME and cycle.places[k].section != cycle.haul.dump]
        if wait.home:
            return home
        onward = [k for k in options if k not in home]
        return onward if place == Place(Leg.HOME, cycle.haul.home) else [*onward, *home]
