"""The part of IREDES' loader production that is written, as data, and the check of a file against it.

Names, order, types and what must be there follow OPC UA for Mining, Part 1: IREDES (OPC 40568-1, v1.0.0): Tables 64 and 66
(LTPPwaitProc), 67 (LTPPTimeRep), 70 and 72 (LTPPMission), 73 and 75 (LTPPaccPts), 76 (LTPPLoadRep), enumerations of 6.7 to 6.9.
The tables and the enumerations were compared with reference.opcfoundation.org, what is mandatory in a trip with the published
node set (types 1018, 1019, 1025, 1028). What is optional there and not known here (IDs of tags, operator, area, observations) is
not written. The specification types waiting times as DateTime though they are durations; they are written as durations (PT12.5S).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree as ET

NAMESPACE = "urn:lhdmap:iredes-excerpt:1"
POINTS = ("LoadPt", "DumpPt", "Parking", "Boulder", "Workshop", "Others")
ACTIONS = ("Load", "Dump", "Parking", "Workshop", "Other")


class Field(NamedTuple):
    """An element: its type (`count`, `time`, `duration`, `text`, names of an enumeration, digits of a number, or fields)."""

    name: str
    kind: str | int | tuple[str, ...] | tuple[Field, ...]
    required: bool = True
    many: bool = False


_WAIT = tuple(
    Field(name, "duration", required=False)
    for name in ("BlastDelay", "CantDump", "Traffic", "NoRock", "MineUtils", "RoadMaint")
)
_TIMES = (Field("LTPPStartTime", "time"), Field("LTPPEndTime", "time"))
_PAIR = (
    Field("LTPPLdrawPtN", "text"),
    Field("LTPPLdumpPtN", "text"),
    Field("LTPPLmass", 2),
    Field("LTPPLcycl", "count"),
    Field("LTPPLdist", 2),
    Field("LTPPTimeRep", _TIMES, required=False, many=True),
)
_MISSION = (
    Field("LTPPMisSeq", "count"),
    Field("LTPPMptFromN", "text"),
    Field("LTPPMptFromType", tuple(name for name in POINTS if name != "Boulder"), required=False),
    Field("LTPPMptToN", "text"),
    Field("LTPPMptToType", POINTS, required=False),
    Field("LTPPMisstart", "time"),
    Field("LTPPMissEnd", "time"),
    Field("LTPPMwaitPoint", "duration", required=False),
    Field("LTPPMaction", ACTIONS),
    Field("LTPPMwaitgen", "duration", required=False),
    Field("LTPPMtimeAct", "duration", required=False),
    Field("LTPPMpayld", 2),
    Field("LTPPMtramEnd", "time"),
    Field("LTPPMtramDist", 4),
)
LOAD_REPORT = Field(
    "LTPPLoadRep",
    (
        Field("LTPPCyclTot", "count"),
        Field("LTPPdistTot", 1, required=False),
        Field("LTPPwrkDist", 1, required=False),
        Field("LTPPloadTot", 2),
        Field("LTPPwaitProc", _WAIT, required=False),
        Field("LTPPaccPts", _PAIR, required=False, many=True),
        Field("LTPPMission", _MISSION, required=False, many=True),
    ),
)
"""Numbers in kilometres and tonnes: the digits behind the point are the resolution (0.1 km, 0.01 t; a mission's way 0.0001 km)."""

_TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?Z")
_DURATION = re.compile(r"PT\d+(\.\d+)?S")


def faults_of(root: ET.Element) -> Iterator[str]:
    """Yield what in a report is not as it should be: names, order, how often, types, resolution; ends before begins."""
    if root.tag != f"{{{NAMESPACE}}}{LOAD_REPORT.name}":
        yield f"root is {root.tag}, {LOAD_REPORT.name} was wanted"
        return
    yield from _element(root, LOAD_REPORT, LOAD_REPORT.name)


def _element(element: ET.Element, field: Field, where: str) -> Iterator[str]:
    fields = _fields(field)
    if fields is None:
        yield from _leaf((element.text or "").strip(), field, where)
        return
    own = [child.tag.removeprefix(f"{{{NAMESPACE}}}") for child in element]
    order = [one.name for one in fields]
    yield from (f"{where}: {name} is not known" for name in own if name not in order)
    places = [order.index(name) for name in own if name in order]
    if places != sorted(places):
        yield f"{where}: its elements are not in order"
    for one in fields:
        count = own.count(one.name)
        if one.required and not count:
            yield f"{where}: {one.name} is missing"
        if count > 1 and not one.many:
            yield f"{where}: {one.name} stands {count} times"
    by_name = {one.name: one for one in fields}
    for child, name in zip(element, own, strict=True):
        if name in by_name:
            yield from _element(child, by_name[name], f"{where}/{name}")
    yield from _order_of_times(element, where)


def _fields(field: Field) -> tuple[Field, ...] | None:
    kind = field.kind
    return kind if isinstance(kind, tuple) and isinstance(kind[0], Field) else None  # type: ignore[return-value]


def _leaf(text: str, field: Field, where: str) -> Iterator[str]:
    kind = field.kind
    if isinstance(kind, int):
        digits = len(text.partition(".")[2])
        number = _number(text)
        if number is None or number < 0.0 or digits != kind:
            yield f"{where}: '{text}', a number with {kind} digits behind the point was wanted"
    elif isinstance(kind, tuple):
        if text not in kind:
            yield f"{where}: '{text}', one of {', '.join(map(str, kind))} was wanted"
    else:
        good = {
            "count": text.isdecimal(),
            "text": bool(text),
            "time": bool(_TIME.fullmatch(text)),
            "duration": bool(_DURATION.fullmatch(text)),
        }
        if not good[kind]:
            yield f"{where}: '{text}' is no {kind}"


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _order_of_times(element: ET.Element, where: str) -> Iterator[str]:
    for first, last in (("LTPPMisstart", "LTPPMissEnd"), ("LTPPStartTime", "LTPPEndTime")):
        begin, end = (element.findtext(f"{{{NAMESPACE}}}{name}") for name in (first, last))
        if begin is not None and end is not None and end < begin:
            yield f"{where}: {last} is before {first}"
