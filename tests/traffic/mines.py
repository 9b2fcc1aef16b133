"""Test mines as in the haulage findings, Section 5, whose lengths are not given: a one-way ring, a drift with a bay, the same with
a pocket at the dump, a loop with a stem."""

from __future__ import annotations

from collections.abc import Callable

from lhdmap.traffic.sections import Haul, SectionMap, named

Mine = tuple[SectionMap, dict[str, Haul]]


def ring(count: int = 3) -> Mine:
    """420 m one way in 12 sections, load and dump on it, places to park between them."""
    names = [f"r{k}" for k in range(12)]
    parks = [f"p{k}" for k in range(count)]
    sections = named(
        [*((name, 35.0) for name in names), *((name, 15.0) for name in parks)],
        one_way=[" ".join([*names, "r0"]), *(f"r10 {park} r11" for park in parks)],
    )
    return sections, {f"m{k}": Haul("r0", "r6", parks[k]) for k in range(count)}


def drift(count: int = 3, *, bay: bool = True, pocket: bool = False) -> Mine:
    """Draw points of their own, 25 m beside a drift of 105 m in single lane with a bay at its middle, the dump at its end.

    `pocket`: two places side by side in front of the dump.
    """
    draws = [f"dp{k}" for k in range(count)]
    sections = [*((name, 25.0) for name in draws), ("j", 10.0), *((f"a{k}", 20.0) for k in range(2)), ("mid", 25.0)]
    sections += [("bay", 25.0)] if bay else []
    sections += [*((f"b{k}", 20.0) for k in range(2)), ("dump", 12.0)]
    ways = [*(f"{name} j" for name in draws), "j a0 a1 mid b0 b1"]
    ways += ["a1 bay b0"] if bay else []
    if pocket:
        sections += [("pocket0", 14.0), ("pocket1", 14.0)]
        ways += ["b1 pocket0 dump", "b1 pocket1 dump"]
    else:
        ways += ["b1 dump"]
    return named(sections, ways), {f"m{k}": Haul(name, "dump", name) for k, name in enumerate(draws)}


def loop(count: int = 3, *, pocket: bool = False, stem_m: float = 80.0) -> Mine:
    """The ring with the draw point on it, and a stem in single lane from a junction of 12 m to the dump."""
    ring_names = [f"l{k}" for k in range(12)]
    stem = [f"s{k}" for k in range(round(stem_m / 20.0))]
    parks = [f"p{k}" for k in range(count)]
    sections = [("x", 12.0), *((name, 34.0) for name in ring_names), *((name, 20.0) for name in stem), ("dump", 12.0)]
    sections += [(name, 15.0) for name in parks]
    ends = stem[-1]
    ways = [" ".join(["x", *stem])]
    if pocket:
        sections += [("pocket0", 14.0), ("pocket1", 14.0)]
        ways += [f"{ends} pocket0 dump", f"{ends} pocket1 dump"]
    else:
        ways += [f"{ends} dump"]
    one_way = [" ".join(["x", *ring_names, "x"]), *(f"l3 {park} l4" for park in parks)]
    return named(sections, ways, one_way), {f"m{k}": Haul("l6", "dump", parks[k]) for k in range(count)}


def pocket_and_bay(count: int = 3) -> Mine:
    return drift(count, pocket=True)


def loop_and_pocket(count: int = 3) -> Mine:
    return loop(count, pocket=True)


def drift_alone(count: int = 3) -> Mine:
    return drift(count, bay=False)


MINES: dict[str, Callable[[int], Mine]] = {
    "ring": ring,
    "drift with bay": drift,
    "pocket and bay": pocket_and_bay,
    "loop and stem": loop,
    "loop, stem and pocket": loop_and_pocket,
    "drift without bay": drift_alone,
}
