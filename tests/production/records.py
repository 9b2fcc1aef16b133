"""Records of cycles made by hand: their figures are known by heart."""

from __future__ import annotations

from lhdmap.haulage.records import Cycle, Interval, Phase

SECOND_NS = 1_000_000_000
START_NS = 1_700_000_000 * SECOND_NS


def intervals(*parts: tuple[Phase, float, str, str, float], begin_s: float = 0.0) -> tuple[Interval, ...]:
    """Return phases one after the other: (phase, seconds, place, cause, metres)."""
    found, at = [], START_NS + round(begin_s * SECOND_NS)
    for phase, seconds, place, cause, metres in parts:
        until = at + round(seconds * SECOND_NS)
        found.append(Interval(phase, at, until, place, cause, metres))
        at = until
    return tuple(found)


def cycle(number: int, begin_s: float, *, fill: float = 0.9, wait_s: float = 0.0, machine: str = "lhd") -> Cycle:
    """Return a bucket of 100 s and `wait_s`: 30 s return over 90 m, 25 s load, 27 s haul over 81 m, 18 s dump."""
    parts = [
        (Phase.RETURN, 30.0, "T1", "", 90.0),
        (Phase.LOAD, 25.0, "DP1", "", 0.0),
        (Phase.TRAFFIC, wait_s, "I1", "no permit for the next section", 0.0),
        (Phase.HAUL, 27.0, "T1", "", 81.0),
        (Phase.DUMP, 18.0, "OP1", "", 0.0),
    ]
    own = intervals(*(part for part in parts if part[1] > 0.0), begin_s=begin_s)
    return Cycle(machine, number, "DP1", "OP1", own, 11.0 * fill, fill, 1 + number % 2, 0.04)


def shift(count: int = 4) -> list[Cycle]:
    """Return buckets one after the other, the second with 20 s of waiting."""
    found, at_s = [], 0.0
    for number in range(1, count + 1):
        one = cycle(number, at_s, fill=0.8 + 0.05 * number, wait_s=20.0 if number == 2 else 0.0)
        found.append(one)
        at_s += one.seconds()
    return found
