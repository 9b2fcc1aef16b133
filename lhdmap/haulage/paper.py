"""The paper's own machine, Table 1 as printed and as recovered: to show what it does, not to drive by.

Figure 2 is missing from the text and the cells of Table 1 are shifted: an OR belongs between the lines of a cell. The reading
here is the most coherent one (`docs/haulage_site.md` lists its faults); `lhdmap.haulage.states` is the machine that is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple


class At(StrEnum):
    """Places that Table 1 speaks of: the waypoints in the order of a cycle, and the rest of each area."""

    LOADING = "loading waypoint"
    A1 = "area 1"
    A1_A2_ENTRY = "entry of the junction from area 1 to 2"
    A1_A2 = "junction from area 1 to 2"
    A1_A2_EXIT = "exit of the junction from area 1 to 2"
    A2_OUT = "area 2, towards area 3"
    A2_A3_ENTRY = "entry of the junction from area 2 to 3"
    A2_A3 = "junction from area 2 to 3"
    A2_A3_EXIT = "exit of the junction from area 2 to 3"
    A3 = "area 3"
    BACKUP = "backup waypoint"
    UNLOADING = "unload waypoint"
    A3_A2_ENTRY = "entry of the junction from area 3 to 2"
    A3_A2 = "junction from area 3 to 2"
    A3_A2_EXIT = "exit of the junction from area 3 to 2"
    A2_BACK = "area 2, towards area 1"
    A2_A1_ENTRY = "entry of the junction from area 2 to 1"
    A2_A1 = "junction from area 2 to 1"
    A2_A1_EXIT = "exit of the junction from area 2 to 1"


class Case(NamedTuple):
    """One line of a cell: the load that it wants (None: either), and the places at which it holds (none: anywhere)."""

    loaded: bool | None
    places: frozenset[At] = frozenset()

    def holds(self, at: At, *, loaded: bool) -> bool:
        """Return whether it does."""
        return self.loaded in (None, loaded) and (not self.places or at in self.places)


def _case(loaded: bool | None, *places: At) -> Case:
    return Case(loaded, frozenset(places))


EVENTS: dict[str, tuple[Case, ...]] = {
    "E5": (_case(True),),
    "E6": (_case(False, At.LOADING),),
    "E7": (_case(True, At.A1_A2_ENTRY),),
    "E8": (_case(False, At.A2_A1_EXIT),),
    "E9": (_case(True, At.A1_A2_EXIT),),
    "E10": (_case(True, At.A1_A2_ENTRY), _case(False, At.A3_A2_ENTRY)),
    "E11": (_case(True, At.A2_A3_ENTRY), _case(False, At.A2_A1_ENTRY)),
    "E12": (_case(None, At.A2_A3_EXIT), _case(None, At.A2_A1_EXIT)),
    "E14": (_case(False, At.A3_A2_ENTRY),),
    "E15": (_case(True, At.BACKUP),),
    "E16": (_case(True, At.UNLOADING),),
    "E17": (_case(False),),
    "E18": (_case(False, At.A3_A2_EXIT),),
}
"""Table 1, recovered; E1 to E4 (which area the truck is in) and E13 (is loaded) are levels, no events, and lead nowhere."""

LEAVES: dict[int, tuple[tuple[str, int], ...]] = {
    1: (("E5", 2),),
    2: (("E7", 3), ("E10", 3)),
    3: (("E9", 4),),
    4: (("E11", 5),),
    5: (("E12", 6),),
    6: (("E16", 7),),
    7: (("E17", 8),),
    8: (("E14", 9), ("E10", 9)),
    9: (("E18", 10),),
    10: (("E11", 11),),
    11: (("E8", 12), ("E12", 12)),
    12: (("E6", 13),),
    13: (),
}
"""By which events each of the 13 stages is left, and for which; none leads out of 13, so nothing starts the second cycle."""

NOMINAL: tuple[tuple[At, bool], ...] = (
    (At.LOADING, False),
    (At.LOADING, True),
    *((at, True) for at in list(At)[1:12]),
    (At.UNLOADING, False),
    (At.A3, False),
    *((at, False) for at in list(At)[12:]),
    (At.A1, False),
    (At.LOADING, False),
    (At.LOADING, True),
)
"""A cycle without a hitch, as places and loads in order, and the next bucket."""
_WHERE: dict[At, frozenset[int]] = {
    At.LOADING: frozenset({1, 12, 13}),
    At.A1: frozenset({2, 12}),
    At.A1_A2_ENTRY: frozenset({2, 3}),
    At.A1_A2: frozenset({3}),
    At.A1_A2_EXIT: frozenset({3, 4}),
    At.A2_OUT: frozenset({4}),
    At.A2_A3_ENTRY: frozenset({4, 5}),
    At.A2_A3: frozenset({5}),
    At.A2_A3_EXIT: frozenset({5, 6}),
    At.A3: frozenset({6, 8}),
    At.BACKUP: frozenset({6}),
    At.UNLOADING: frozenset({6, 7, 8}),
    At.A3_A2_ENTRY: frozenset({8, 9}),
    At.A3_A2: frozenset({9}),
    At.A3_A2_EXIT: frozenset({9, 10}),
    At.A2_BACK: frozenset({10}),
    At.A2_A1_ENTRY: frozenset({10, 11}),
    At.A2_A1: frozenset({11}),
    At.A2_A1_EXIT: frozenset({11, 12}),
}
_LOADED = frozenset({1, 2, 3, 4, 5, 6, 7})
_EMPTY = frozenset({1, 7, 8, 9, 10, 11, 12, 13})


def events_at(at: At, *, loaded: bool) -> list[str]:
    """Return the events that are true somewhere, those that are mere levels left out (E5, E17: the load itself)."""
    return [
        name
        for name, cases in EVENTS.items()
        if name not in ("E5", "E17") and any(case.holds(at, loaded=loaded) for case in cases)
    ]


def stages_at(at: At, *, loaded: bool) -> frozenset[int]:
    """Return the stages that a truck that is found somewhere could be in: none for half of them."""
    return _WHERE[at] & (_LOADED if loaded else _EMPTY)


def run(moments: Iterator[tuple[At, bool]] | tuple[tuple[At, bool], ...], stage: int = 1) -> list[int]:
    """Return the stages that moments (place, load) lead through, the one at first included."""
    found = [stage]
    for at, loaded in moments:
        for event, following in LEAVES[found[-1]]:
            if any(case.holds(at, loaded=loaded) for case in EVENTS[event]):
                found.append(following)
                break
    return found
