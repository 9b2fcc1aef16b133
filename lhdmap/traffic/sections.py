"""Sections of a map, each held by one machine at a time, and the ways of a machine's cycle through them."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

from lhdmap.errors import InputError, UsageError
from lhdmap.settings import nearest

LEAST_M = 0.1


class Section(NamedTuple):
    """A stretch that one machine holds at a time; `bay`: beside the way, made for waiting."""

    name: str
    length_m: float
    bay: bool = False


@dataclass(frozen=True)
class SectionMap:
    """Sections, and from which one a machine may drive into which (`links`, one way each)."""

    sections: tuple[Section, ...]
    links: tuple[tuple[str, str], ...]

    @cached_property
    def section(self) -> dict[str, Section]:
        """Sections by name."""
        return {one.name: one for one in self.sections}

    @cached_property
    def following(self) -> dict[str, tuple[str, ...]]:
        """Sections that can be driven into from each."""
        return {one.name: tuple(b for a, b in self.links if a == one.name) for one in self.sections}

    @cached_property
    def before(self) -> dict[str, tuple[str, ...]]:
        """Sections that lead into each."""
        return {one.name: tuple(a for a, b in self.links if b == one.name) for one in self.sections}

    def to_go_m(self, goal: str, through_not: Iterable[str] = ()) -> dict[str, float]:
        """Return how far it is from the end of each section to that of `goal`, through none of `through_not`."""
        shut, found = set(through_not) - {goal}, {goal: 0.0}
        queue = [(0.0, goal)]
        while queue:
            far, name = heapq.heappop(queue)
            if far > found[name] or (name in shut and name != goal):
                continue
            for one in self.before.get(name, ()):
                further = far + max(self.section[name].length_m, LEAST_M)
                if further < found.get(one, math.inf):
                    found[one] = further
                    heapq.heappush(queue, (further, one))
        return found


class Leg(StrEnum):
    """What a machine is at in its cycle."""

    EMPTY = "to load"
    LOADED = "to dump"
    HOME = "home"


class Place(NamedTuple):
    """A state of a machine's cycle: its leg, and the section that it is in."""

    leg: Leg
    section: str


class Haul(NamedTuple):
    """What a machine does over and over: sections where it loads, dumps, and waits when it has nothing to do."""

    load: str
    dump: str
    home: str


class Cycle:
    """The cycle of one machine: its states by number, and which can follow which.

    Entering the load section the leg becomes LOADED, entering the dump HOME: there the machine decides whether it goes on to
    load or drives home. Whatever brings it nearer may follow, a bay beside the way as well as the way.
    """

    def __init__(self, sections: SectionMap, haul: Haul) -> None:
        for name in haul:
            if name not in sections.section:
                raise UsageError(f"'{name}' is no section{nearest(name, sections.section)}")
        self.map, self.haul = sections, haul
        works = set(haul)
        self._far = {
            Leg.EMPTY: sections.to_go_m(haul.load, works),
            Leg.LOADED: sections.to_go_m(haul.dump, works),
            Leg.HOME: sections.to_go_m(haul.home, works),
        }
        for leg, start in (
            (Leg.LOADED, haul.load),
            (Leg.EMPTY, haul.dump),
            (Leg.HOME, haul.dump),
            (Leg.EMPTY, haul.home),
        ):
            if start not in self._far[leg]:
                goal = {Leg.LOADED: haul.dump, Leg.EMPTY: haul.load, Leg.HOME: haul.home}[leg]
                raise InputError(f"no way leads from section '{start}' to '{goal}'")
        self.places: list[Place] = []
        self.moves: list[tuple[int, ...]] = []
        self._number: dict[Place, int] = {}
        self.home = self._walk(Place(Leg.HOME, haul.home))
        self.section_of = tuple(place.section for place in self.places)

    def moves_of(self, place: Place) -> tuple[int, ...]:
        """Return the states that can follow a state; none where the machine never is in it."""
        return self.moves[self._number[place]] if place in self._number else ()

    def _walk(self, begin: Place) -> int:
        """Number all states that can be come to; those that follow in order of preference."""
        stack = [begin]
        self._note(begin)
        while stack:
            place = stack.pop()
            following = self._following(place)
            stack += [one for one in following if one not in self._number]
            self.moves[self._number[place]] = tuple(self._note(one) for one in following)
        return self._number[begin]

    def _note(self, place: Place) -> int:
        if place not in self._number:
            self._number[place] = len(self.places)
            self.places.append(place)
            self.moves.append(())
        return self._number[place]

    def _following(self, place: Place) -> list[Place]:
        found = self._nearer(place)
        if place.leg == Leg.HOME and place.section in (self.haul.dump, self.haul.home):
            found = [*self._nearer(Place(Leg.EMPTY, place.section)), *found]
        return found

    def _nearer(self, place: Place) -> list[Place]:
        """Return what brings the machine nearer to where its leg leads, the way before the bays beside it."""
        leg, section = place
        if leg == Leg.EMPTY and section == self.haul.load:  # at home there: it loads where it stands
            return self._nearer(Place(Leg.LOADED, section))
        far, bays = self._far[leg], {name: one.bay for name, one in self.map.section.items()}
        here = far.get(section, math.inf)
        names = [one for one in self.map.following[section] if far.get(one, math.inf) < here]
        aside = [one for one in self.map.following[section] if bays[one] and not bays[section] and far.get(one) == here]
        names += aside  # a pocket before the goal brings nothing nearer, but is one to wait in
        names.sort(key=lambda name: (self.map.section[name].bay, far[name] + self.map.section[name].length_m))
        return [self._arriving(leg, name) for name in names]

    def _arriving(self, leg: Leg, section: str) -> Place:
        if leg == Leg.EMPTY and section == self.haul.load:
            return Place(Leg.LOADED, section)
        return Place(Leg.HOME if leg == Leg.LOADED and section == self.haul.dump else leg, section)


class Times(NamedTuple):
    """Speeds and working times; manoeuvres belong to the work."""

    empty_kmh: float = 12.0
    loaded_kmh: float = 10.0
    load_s: float = 25.0
    dump_s: float = 18.0

    def drive_s(self, section: Section, *, loaded: bool) -> float:
        """Return how long a machine is in a section without a stop."""
        return section.length_m / ((self.loaded_kmh if loaded else self.empty_kmh) / 3.6)


def named(sections: Iterable[tuple[str, float]], both: Iterable[str] = (), one_way: Iterable[str] = ()) -> SectionMap:
    """Return a map from names (those with `bay` in them are bays) and lengths; `both`, `one_way`: chains of names, `A B C`."""
    made = tuple(Section(name, length_m, bay="bay" in name) for name, length_m in sections)
    links: Mapping[tuple[str, str], None] = {}
    for chain, back in [(one, True) for one in both] + [(one, False) for one in one_way]:
        names = chain.split()
        pairs = list(pairwise(names))
        links = {**links, **dict.fromkeys(pairs), **(dict.fromkeys((b, a) for a, b in pairs) if back else {})}
    return SectionMap(made, tuple(links))
