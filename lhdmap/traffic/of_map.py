"""Sections of a topological map: intersections, tunnels (cut where they are long), and passing bays beside them.

A tunnel with a passing bay is cut before and behind it; the bay is a section of its own, beside the piece of the tunnel that it
widens. How the arms of an intersection join is left to navigation: a change of gear in a third arm holds the intersection only.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lhdmap.topology.model import AccessPoint, TopologicalMap, Tunnel, Waypoint
from lhdmap.traffic.sections import Section, SectionMap

SECTION_M = 60.0
BAY_M, POCKET_M = 25.0, 14.0
_LEAST_PIECE_M = 12.0
_CROSSING_M = 10.0
WORKS = ("draw_point", "dump", "park")


class _Cut(NamedTuple):
    """A piece of a tunnel, from and to along its line (m); `bay`: name of the bay beside it."""

    from_m: float
    to_m: float
    bay: str = ""


class MapSections(NamedTuple):
    """The sections of a map, and in which of them each waypoint (by its name) is."""

    map: SectionMap
    places: dict[str, str]


class Extra(NamedTuple):
    """What is tried on a map: a bay in the middle of a tunnel (id), or a pocket beside the way to a waypoint of work."""

    tunnel: str = ""
    pocket: str = ""


NOTHING = Extra()


def sections_of_map(topology: TopologicalMap, section_m: float = SECTION_M, extra: Extra = NOTHING) -> MapSections:
    """Return the sections; none is much longer than `section_m`."""
    sections: list[Section] = []
    links: list[tuple[str, str]] = []
    places: dict[str, str] = {}
    mouths: dict[str, str] = {}  # of each access point: the section that it leads into
    for tunnel in topology.tunnels:
        if tunnel.closed:
            continue
        waypoints = [one for one in topology.waypoints if one.node == tunnel.id]
        cuts = _cuts(tunnel, _bays(tunnel, waypoints, extra.tunnel == tunnel.id), section_m)
        names = [f"{tunnel.name}#{k + 1}" if len(cuts) > 1 else tunnel.name for k in range(len(cuts))]
        sections += [Section(name, cut.to_m - cut.from_m) for name, cut in zip(names, cuts, strict=True)]
        links += pairwise(names)
        for k, cut in enumerate(cuts):
            if cut.bay:
                sections.append(Section(cut.bay, BAY_M, bay=True))
                links += [(names[k - 1], cut.bay)] if k else []
                links += [(cut.bay, names[k + 1])] if k + 1 < len(names) else []
        places |= {one.name: names[_piece(tunnel, cuts, one.pose)] for one in waypoints if one.purpose in WORKS}
        own = [point for point in topology.access_points if point.node == tunnel.id]
        mouths |= {point.id: names[_piece(tunnel, cuts, point.pose)] for point in own}
    for node in topology.intersections:
        sections.append(Section(node.name, _crossing_m(topology, node.id)))
        mouths |= {point.id: node.name for point in topology.access_points if point.node == node.id}
        places |= {one.name: node.name for one in topology.waypoints if one.node == node.id and one.purpose in WORKS}
    links += [link for point in topology.access_points if (link := _joint(point, mouths)) is not None]
    if extra.pocket in places:
        end, pocket = places[extra.pocket], f"pocket at {extra.pocket}"
        sections.append(Section(pocket, POCKET_M, bay=True))
        links += [(one, pocket) for pair in links for one in pair if end in pair and one != end] + [(pocket, end)]
    both = dict.fromkeys(pair for a, b in links for pair in ((a, b), (b, a)))
    return MapSections(SectionMap(tuple(sections), tuple(both)), places)


def _joint(point: AccessPoint, mouths: dict[str, str]) -> tuple[str, str] | None:
    here, there = mouths.get(point.id), mouths.get(point.joins or "")
    return (here, there) if here is not None and there is not None and here != there else None


def _bays(tunnel: Tunnel, waypoints: list[Waypoint], extra: bool) -> list[tuple[float, str]]:
    bays = [(_along_m(tunnel, one.pose), one.name) for one in waypoints if one.purpose == "passing_bay"]
    return sorted([*bays, (0.5 * tunnel.length_m, f"bay in {tunnel.name}")] if extra else bays)


def _cuts(tunnel: Tunnel, bays: list[tuple[float, str]], section_m: float) -> list[_Cut]:
    """Return the pieces of a tunnel; a bay has a piece on either side, where the tunnel is long enough for them."""
    length_m = max(tunnel.length_m, 1.0)
    cuts: list[_Cut] = []
    at_m = 0.0
    for middle_m, name in bays:
        low = max(middle_m - 0.5 * BAY_M, at_m + _LEAST_PIECE_M)
        high = min(middle_m + 0.5 * BAY_M, length_m - _LEAST_PIECE_M)
        if high - low >= _LEAST_PIECE_M:
            cuts += [*_plain(at_m, low, section_m), _Cut(low, high, name)]
            at_m = high
    return [*cuts, *_plain(at_m, length_m, section_m)]


def _plain(from_m: float, to_m: float, section_m: float) -> list[_Cut]:
    count = max(math.ceil((to_m - from_m) / section_m - 0.25), 1)
    edges = np.linspace(from_m, to_m, count + 1).tolist()
    return [_Cut(a, b) for a, b in pairwise(edges)]


def _piece(tunnel: Tunnel, cuts: list[_Cut], pose: np.ndarray) -> int:
    at_m = _along_m(tunnel, pose)
    return next((k for k, cut in enumerate(cuts) if at_m < cut.to_m), len(cuts) - 1)


def _along_m(tunnel: Tunnel, pose: np.ndarray) -> float:
    """Return where along a tunnel's line a pose is."""
    line = tunnel.line_m
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return float(s[int(np.argmin(np.linalg.norm(line[:, :2] - pose[:2], axis=1)))])


def _crossing_m(topology: TopologicalMap, node: str) -> float:
    lengths = [one.length_m for one in topology.connections if topology.points[one.start].node == node]
    return float(np.median(lengths)) if lengths else _CROSSING_M
