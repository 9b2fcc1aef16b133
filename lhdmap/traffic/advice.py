"""What throughput a map allows with several machines, and where a passing bay would pay: findings for check-map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lhdmap.errors import LhdmapError
from lhdmap.movement.findings import Finding
from lhdmap.topology.model import TopologicalMap, Tunnel
from lhdmap.traffic.of_map import BAY_M, NOTHING, Extra, MapSections, sections_of_map
from lhdmap.traffic.sections import Haul, SectionMap
from lhdmap.traffic.settings import TrafficSettings
from lhdmap.traffic.simulation import Shift, simulate

_MOST_TRIES = 6
_ROOM_M = BAY_M + 2 * 12.0


class Throughput(NamedTuple):
    """What several machines do, as a multiple of what the first of them does alone; the longest wait for a section (s)."""

    dump: str
    machines: int
    ratio: float
    longest_wait_s: float


def traffic_findings(
    topology: TopologicalMap, machines: int = 3, settings: TrafficSettings | None = None
) -> Iterator[Finding]:
    """Yield, for each dump, what `machines` machines achieve on this map, and the tunnel in which a bay would add most."""
    chosen = settings or TrafficSettings()
    for dump in (one.name for one in topology.waypoints if one.purpose == "dump"):
        try:
            found = throughput(topology, dump, machines, chosen)
            if found is None:
                continue
            best, what = _best_bay(topology, found, chosen)
        except LhdmapError as error:
            yield Finding("note", "traffic", dump, f"throughput is not known: {error}")
            continue
        text = f"{found.machines} machines dump {found.ratio:.1f} times what one does; longest wait {found.longest_wait_s:.0f} s"
        if best >= found.ratio + chosen.pays:
            text += f"; {what} would make it {best:.1f} times"
        yield Finding("note", "traffic", dump, text)


def throughput(
    topology: TopologicalMap, dump: str, machines: int, settings: TrafficSettings | None = None, extra: Extra = NOTHING
) -> Throughput | None:
    """Return the throughput to a dump from the nearest draw points; None where there are not two machines' worth of places.

    Each machine has a draw point of its own, and is at home there; a single one is shared by machines that are at home in parks.

    Raises:
        InputError: a draw point and the dump are not joined.
        UsageError: the map is too large for the search.
    """
    chosen = settings or TrafficSettings()
    made = sections_of_map(topology, chosen.section_m, extra)
    hauls = _hauls(topology, made, dump, machines)
    if len(hauls) < 2:
        return None

    def dumped(some: dict[str, Haul]) -> Shift:
        return simulate(made.map, some, chosen.hours, chosen.times, chosen.chance, chosen.machine_m)

    one, several = dumped(dict(list(hauls.items())[:1])), dumped(hauls)
    ratio = several.total / one.total if one.total else 0.0
    return Throughput(dump, len(hauls), ratio, several.longest_wait_s)


def _hauls(topology: TopologicalMap, made: MapSections, dump: str, machines: int) -> dict[str, Haul]:
    at, to_go_m = made.places.get(dump, ""), _to_go_m(made.map, made.places.get(dump, ""))
    draws = [one.name for one in topology.waypoints if one.purpose == "draw_point" and one.name in made.places]
    draws = sorted(
        (name for name in draws if made.places[name] in to_go_m), key=lambda name: to_go_m[made.places[name]]
    )
    loads = dict.fromkeys(made.places[name] for name in draws if made.places[name] != at)
    parks = dict.fromkeys(
        made.places[one.name] for one in topology.waypoints if one.purpose == "park" and one.name in made.places
    )
    hauls = [Haul(load, at, load) for load in loads]
    if len(loads) == 1:
        (load,) = loads
        hauls = [Haul(load, at, park) for park in parks if park not in (load, at) and park in to_go_m]
    return {f"machine {k + 1}": haul for k, haul in enumerate(hauls[:machines])}


def _to_go_m(sections: SectionMap, goal: str) -> dict[str, float]:
    return sections.to_go_m(goal) if goal in sections.section else {}


def _best_bay(topology: TopologicalMap, found: Throughput, settings: TrafficSettings) -> tuple[float, str]:
    """Return the best ratio that one more place to wait gives, and what: a pocket at the dump, bays on the way to it."""
    made = sections_of_map(topology, settings.section_m)
    hauls = _hauls(topology, made, found.dump, found.machines)
    used = [name for haul in hauls.values() for name in _way(made.map, haul.load, haul.dump)]
    tunnels = [one for one in topology.tunnels if _wants_bay(topology, one) and any(_is_of(name, one) for name in used)]
    longest = sorted(tunnels, key=lambda one: -one.length_m)[:_MOST_TRIES]
    tries = [(Extra(pocket=found.dump), f"a pocket in front of {found.dump}")]
    tries += [(Extra(tunnel=one.id), f"a passing bay in the middle of {one.name}") for one in longest]
    best, what = 0.0, ""
    for extra, words in tries:
        tried = throughput(topology, found.dump, found.machines, settings, extra)
        if tried is not None and tried.ratio > best:
            best, what = tried.ratio, words
    return best, what


def _wants_bay(topology: TopologicalMap, tunnel: Tunnel) -> bool:
    has = any(one.node == tunnel.id and one.purpose == "passing_bay" for one in topology.waypoints)
    return not has and tunnel.length_m >= _ROOM_M


def _is_of(section: str, tunnel: Tunnel) -> bool:
    return section == tunnel.name or section.startswith(f"{tunnel.name}#")


def _way(sections: SectionMap, start: str, goal: str) -> list[str]:
    """Return the sections of the shortest way, both ends included."""
    to_go_m, found = sections.to_go_m(goal), [start]
    while found[-1] != goal:
        found.append(
            min(
                sections.following[found[-1]],
                key=lambda name: to_go_m.get(name, float("inf")) + sections.section[name].length_m,
            )
        )
    return found
