"""Loader production in the elements of IREDES: `iredes_xml(cycles)`. What is in it and how it is checked: `iredes_schema`.

A mission of IREDES is a trip: tramming from a point to another, and what is done there. A cycle has two, from the dump to the
draw point and back; a way to the park is one, too. Waiting for the point is what QUEUE counts, all other holds are general.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import NamedTuple
from xml.etree import ElementTree as ET

from lhdmap.haulage.records import DRIVES, HOLDS, Cycle, Interval, Phase
from lhdmap.production.iredes_schema import NAMESPACE

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
WAITS = {
    Phase.QUEUE_DUMP: "CantDump",
    Phase.TRAFFIC: "Traffic",
    Phase.QUEUE_LOAD: "NoRock",
    Phase.OBSTACLE: "RoadMaint",
    Phase.NO_ROUTE: "RoadMaint",
}
"""Which process wait a hold is; assistance, a lost place and an emergency stop are none of the mine's process."""
_ORDER = ("BlastDelay", "CantDump", "Traffic", "NoRock", "MineUtils", "RoadMaint")
_QUEUES = (Phase.QUEUE_LOAD, Phase.QUEUE_DUMP)


class Trip(NamedTuple):
    """A mission of IREDES: from a point to another, and what is done there; points are (name, type)."""

    begin: tuple[str, str]
    end: tuple[str, str]
    action: str
    intervals: tuple[Interval, ...]
    payload_t: float


def trips_of(cycles: Sequence[Cycle]) -> list[Trip]:
    """Return the trips of one machine in order; each ends with what is done at its end; one that has no end yet is none."""
    trips: list[Trip] = []
    at = ("park", "Parking")
    for cycle in cycles:
        parts: list[Interval] = []
        for number, one in enumerate(cycle.intervals):
            parts.append(one)
            following = cycle.intervals[number + 1].phase if number + 1 < len(cycle.intervals) else None
            end = _end_of(cycle, one, following)
            if end is not None:
                trips.append(_trip(at, end, parts, cycle))
                at, parts = end, []
    return [one for one in trips if any(part.phase in DRIVES for part in one.intervals)]


def _end_of(cycle: Cycle, one: Interval, following: Phase | None) -> tuple[str, str] | None:
    """Return the point at which a trip ends with an interval; None: it goes on."""
    if following == one.phase:
        return None
    if one.phase == Phase.LOAD and following not in (Phase.ASSISTANCE, Phase.STOPPED):
        return cycle.load or one.place or "draw point", "LoadPt"
    if one.phase == Phase.DUMP and following not in (Phase.ASSISTANCE, Phase.STOPPED):
        return cycle.dump or one.place or "dump", "DumpPt"
    return (one.place or "park", "Parking") if one.phase == Phase.PARK and following in (None, Phase.IDLE) else None


def _trip(begin: tuple[str, str], end: tuple[str, str], parts: Sequence[Interval], cycle: Cycle) -> Trip:
    action = {"LoadPt": "Load", "DumpPt": "Dump"}.get(end[1], "Parking")
    mass = cycle.mass_t if action == "Dump" and math.isfinite(cycle.mass_t) else 0.0
    return Trip(begin, end, action, tuple(parts), mass)


def iredes_xml(cycles: Sequence[Cycle]) -> str:
    """Return the report of one machine as XML."""
    ET.register_namespace("", NAMESPACE)
    root = ET.Element(_tag("LTPPLoadRep"))
    done = [one for one in cycles if one.finished]
    parts = [part for one in cycles for part in one.intervals]
    loaded = sum(part.distance_m for part in parts if part.phase in (Phase.HAUL, Phase.RETURN))
    _add(root, "LTPPCyclTot", str(len(done)))
    _add(root, "LTPPdistTot", _km(sum(part.distance_m for part in parts), 1))
    _add(root, "LTPPwrkDist", _km(loaded, 1))
    _add(root, "LTPPloadTot", f"{_mass_t(done):.2f}")
    _waits(root, parts)
    for pair in dict.fromkeys((one.load, one.dump) for one in done):
        _pair(root, *pair, [one for one in done if (one.load, one.dump) == pair])
    for number, trip in enumerate(trips_of(cycles), start=1):
        _mission(root, number, trip)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _waits(root: ET.Element, parts: Sequence[Interval]) -> None:
    element = ET.SubElement(root, _tag("LTPPwaitProc"))
    for name in _ORDER:
        seconds = sum(part.s for part in parts if WAITS.get(part.phase) == name)
        if seconds > 0.0:
            _add(element, name, _duration(seconds))


def _pair(root: ET.Element, load: str, dump: str, cycles: Sequence[Cycle]) -> None:
    element = ET.SubElement(root, _tag("LTPPaccPts"))
    _add(element, "LTPPLdrawPtN", load or "draw point")
    _add(element, "LTPPLdumpPtN", dump or "dump")
    _add(element, "LTPPLmass", f"{_mass_t(cycles):.2f}")
    _add(element, "LTPPLcycl", str(len(cycles)))
    _add(element, "LTPPLdist", _km(sum(one.distance_m for one in cycles), 2) or "0.00")
    for from_ns, to_ns in _runs(cycles):
        times = ET.SubElement(element, _tag("LTPPTimeRep"))
        _add(times, "LTPPStartTime", _time(from_ns))
        _add(times, "LTPPEndTime", _time(to_ns))


def _runs(cycles: Sequence[Cycle]) -> Iterator[tuple[int, int]]:
    """Yield from when to when without interruption: cycles that follow each other."""
    begin, end = cycles[0].from_ns, cycles[0].to_ns
    for one in cycles[1:]:
        if one.from_ns > end:
            yield begin, end
            begin = one.from_ns
        end = one.to_ns
    yield begin, end


def _mission(root: ET.Element, number: int, trip: Trip) -> None:
    element = ET.SubElement(root, _tag("LTPPMission"))
    parts = trip.intervals
    drives = [part for part in parts if part.phase in DRIVES]
    act = sum(part.s for part in parts if part.phase in (Phase.LOAD, Phase.DUMP))
    point = sum(part.s for part in parts if part.phase in _QUEUES)
    others = sum(part.s for part in parts if part.phase in HOLDS and part.phase not in _QUEUES)
    for name, text in (
        ("LTPPMisSeq", str(number)),
        ("LTPPMptFromN", trip.begin[0]),
        ("LTPPMptFromType", trip.begin[1]),
        ("LTPPMptToN", trip.end[0]),
        ("LTPPMptToType", trip.end[1]),
        ("LTPPMisstart", _time(parts[0].from_ns)),
        ("LTPPMissEnd", _time(parts[-1].to_ns)),
        ("LTPPMwaitPoint", _duration(point)),
        ("LTPPMaction", trip.action),
        ("LTPPMwaitgen", _duration(others)),
        ("LTPPMtimeAct", _duration(act)),
        ("LTPPMpayld", f"{trip.payload_t:.2f}"),
        ("LTPPMtramEnd", _time(drives[-1].to_ns)),
        ("LTPPMtramDist", _km(sum(part.distance_m for part in drives), 4)),
    ):
        _add(element, name, text)


def _mass_t(cycles: Sequence[Cycle]) -> float:
    return sum(one.mass_t for one in cycles if math.isfinite(one.mass_t))


def _km(way_m: float, digits: int) -> str:
    """Return kilometres, nothing where they are not known."""
    return f"{way_m / 1000.0:.{digits}f}" if math.isfinite(way_m) else ""


def _add(parent: ET.Element, name: str, text: str) -> None:
    """Add an element; one that has nothing to say is left out."""
    if text:
        ET.SubElement(parent, _tag(name)).text = text


def _tag(name: str) -> str:
    return f"{{{NAMESPACE}}}{name}"


def _time(stamp_ns: int) -> str:
    at = _EPOCH + timedelta(seconds=stamp_ns // 1_000_000_000)
    return f"{at:%Y-%m-%dT%H:%M:%S}.{stamp_ns % 1_000_000_000 // 1_000_000:03d}Z"


def _duration(seconds: float) -> str:
    return f"PT{seconds:.1f}S"
