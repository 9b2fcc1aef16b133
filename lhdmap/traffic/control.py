"""Section control: who may drive into which section next. Pure: time is an input, grants are the output.

A machine holds the section that it is in, and the one behind it until its rear has left it. What it wants next is granted where
that is free and the state after it is safe (`lhdmap.traffic.claims`); who has waited longest is asked first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lhdmap.traffic.claims import Claims, Joint
from lhdmap.traffic.sections import Cycle, Haul, Leg, Place, SectionMap


class Grant(NamedTuple):
    """A machine may drive into a section, and is on this leg then."""

    machine: str
    section: str
    leg: Leg


class TrafficControl:
    """Controls machines on one map; each begins at its home."""

    def __init__(self, sections: SectionMap, hauls: Mapping[str, Haul]) -> None:
        self.names = list(hauls)
        self.claims = Claims([Cycle(sections, haul) for haul in hauls.values()])
        self._at: Joint = self.claims.home
        self._behind: dict[str, str] = {}
        self._waits: dict[str, tuple[int, str]] = {}

    def place(self, machine: str) -> Place:
        """Return what a machine is at: the section that was granted last."""
        who = self.names.index(machine)
        return self.claims.cycles[who].places[self._at[who]]

    def held(self) -> dict[str, str]:
        """Return who holds each section that is held."""
        front = {self.place(name).section: name for name in self.names}
        return {section: name for name, section in self._behind.items()} | front

    def wants(self, machine: str, now_ns: int, towards: str = "") -> None:
        """A machine asks to go on: where it may choose, `load` or `home` (`towards`), else wherever its way leads."""
        since, _ = self._waits.get(machine, (now_ns, ""))
        self._waits[machine] = (since, towards)

    def left(self, machine: str) -> None:
        """The rear of a machine has left the section behind it."""
        self._behind.pop(machine, None)

    def waiting(self) -> dict[str, int]:
        """Return who waits, and since when."""
        return {name: since for name, (since, _) in self._waits.items()}

    def step(self) -> list[Grant]:
        """Return what is granted now, in order; a machine that got something asks anew for what follows."""
        given: list[Grant] = []
        while (grant := self._next()) is not None:
            given.append(grant)
        return given

    def _next(self) -> Grant | None:
        held = self.held()
        for name in sorted(self._waits, key=lambda name: (self._waits[name][0], self.names.index(name))):
            who = self.names.index(name)
            if name in self._behind:
                continue  # its rear is still in the section behind: a third one is not held
            for following in self._options(who, self._waits[name][1]):
                after = (*self._at[:who], following, *self._at[who + 1 :])
                place = self.claims.cycles[who].places[following]
                if held.get(place.section, name) == name and self.claims.safe(after):
                    self._behind[name] = self.place(name).section
                    self._at = after
                    del self._waits[name]
                    return Grant(name, place.section, place.leg)
        return None

    def _options(self, who: int, towards: str) -> Sequence[int]:
        """Return the states that a machine may go to, the best first; home only where that is wanted, or nothing else is safe."""
        cycle = self.claims.cycles[who]
        options = cycle.moves[self._at[who]]
        place = cycle.places[self._at[who]]
        if place.leg != Leg.HOME or place.section not in (cycle.haul.dump, cycle.haul.home):
            return options
        home = [k for k in options if cycle.places[k].leg == Leg.HOME]
        if towards == "home":
            return home
        return options if place.section == cycle.haul.dump else [k for k in options if k not in home]
