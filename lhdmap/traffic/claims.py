"""Which joint states of several machines are safe: from where all can still finish their cycles and be home, exactly, by search.

Each machine claims its whole cycle and the way home. A state is safe if there is an order of moves, each into a free section,
that brings all home. A move is granted only into a safe state, so there is always one that can be granted: no deadlock, and
none is refused without need (the set is exact, not the part of it that a rule finds).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.errors import UsageError
from lhdmap.traffic.sections import Cycle, Leg

Joint = tuple[int, ...]
MOST_STATES = 2_000_000


class Claims:
    """Joint states of machines with these cycles; what was found once is kept."""

    def __init__(self, cycles: Sequence[Cycle]) -> None:
        homes = [one.haul.home for one in cycles]
        twice = next((name for name in homes if homes.count(name) > 1), None)
        if twice is not None:
            raise UsageError(f"two machines are at home in '{twice}': each wants a place of its own")
        self.cycles = tuple(cycles)
        self.home: Joint = tuple(one.home for one in cycles)
        self._safe: dict[Joint, bool] = {self.home: True}

    @property
    def known(self) -> int:
        """How many joint states have been looked at."""
        return len(self._safe)

    def moves(self, at: Joint) -> Iterator[tuple[int, Joint]]:
        """Yield each move of one machine into a section that nobody is in: who, and the state after it."""
        held = {cycle.section_of[k] for cycle, k in zip(self.cycles, at, strict=True)}
        for who, (cycle, k) in enumerate(zip(self.cycles, at, strict=True)):
            for following in cycle.moves[k]:
                section = cycle.section_of[following]
                if section not in held or section == cycle.section_of[k]:
                    yield who, (*at[:who], following, *at[who + 1 :])

    def can_dump_alone(self, who: int) -> bool:
        """Return whether a machine can drive its cycle while all others are at home."""
        cycle = self.cycles[who]
        seen, stack = {self.home}, [self.home]
        while stack:
            for one, after in self.moves(stack.pop()):
                if one == who and after not in seen:
                    place = cycle.places[after[who]]
                    if place.leg == Leg.HOME and place.section == cycle.haul.dump:
                        return True
                    seen.add(after)
                    stack.append(after)
        return False

    def safe(self, at: Joint) -> bool:
        """Return whether all can be brought home from there.

        Raises:
            UsageError: there are more states than can be looked at.
        """
        known = self._safe.get(at)
        return self._search(at) if known is None else known

    def _search(self, begin: Joint) -> bool:
        """Look for a way into a state known to be safe: all states on it are safe. Where there is none, none that was seen is."""
        came: dict[Joint, Joint | None] = {begin: None}
        stack = [begin]
        while stack:
            at = stack.pop()
            for _, after in self._homeward(at):
                known = self._safe.get(after)
                if known:
                    self._mark(at, came)
                    return True
                if known is None and after not in came:
                    came[after] = at
                    stack.append(after)
            if len(came) + self.known > MOST_STATES:
                raise UsageError(
                    f"more than {MOST_STATES} joint states of {len(self.cycles)} machines: fewer sections were wanted"
                )
        self._safe.update(dict.fromkeys(came, False))
        return False

    def _homeward(self, at: Joint) -> list[tuple[int, Joint]]:
        """Return the moves, those that are looked at first last: of the machine that is nearest to home."""
        return sorted(self.moves(at), key=lambda move: -move[0])

    def _mark(self, last: Joint, came: dict[Joint, Joint | None]) -> None:
        at: Joint | None = last
        while at is not None:
            self._safe[at] = True
            at = came[at]
