"""All interleavings of several machines under the exact claims: `explore(claims)`."""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.traffic.claims import Claims, Joint
from lhdmap.traffic.sections import Leg


class Interleavings(NamedTuple):
    """What was found, as joint states.

    `shared`: two are in one section; `stuck`: no move is granted; `never_again`: some machine can never dump again from there.
    """

    states: int
    moves: int
    shared: tuple[Joint, ...]
    stuck: tuple[Joint, ...]
    never_again: tuple[Joint, ...]

    @property
    def sound(self) -> bool:
        """Whether nothing was found."""
        return not (self.shared or self.stuck or self.never_again)


def explore(claims: Claims) -> Interleavings:
    """Go through all joint states that come about if each granted move may be made, in each order, from all being home."""
    found: dict[Joint, list[tuple[int, Joint]]] = {}
    stack = [claims.home]
    while stack:
        at = stack.pop()
        if at in found:
            continue
        found[at] = [(who, after) for who, after in claims.moves(at) if claims.safe(after)]
        stack += [after for _, after in found[at] if after not in found]
    shared = tuple(at for at in found if _shares(claims, at))
    stuck = tuple(at for at, moves in found.items() if not moves)
    return Interleavings(len(found), sum(map(len, found.values())), shared, stuck, _never_again(claims, found))


def _shares(claims: Claims, at: Joint) -> bool:
    return len({cycle.section_of[k] for cycle, k in zip(claims.cycles, at, strict=True)}) < len(at)


def _never_again(claims: Claims, found: dict[Joint, list[tuple[int, Joint]]]) -> tuple[Joint, ...]:
    """Return the states from which some machine cannot come to a dump any more."""
    before: dict[Joint, list[Joint]] = {at: [] for at in found}
    for at, moves in found.items():
        for _, after in moves:
            before[after].append(at)
    bad: dict[Joint, None] = {}
    for who, cycle in enumerate(claims.cycles):
        dumps = {
            k for k, place in enumerate(cycle.places) if place.section == cycle.haul.dump and place.leg == Leg.HOME
        }
        able = {at for at, moves in found.items() if any(one == who and after[who] in dumps for one, after in moves)}
        stack = list(able)
        while stack:
            for at in before[stack.pop()]:
                if at not in able:
                    able.add(at)
                    stack.append(at)
        bad |= dict.fromkeys(at for at in found if at not in able)
    return tuple(bad)
