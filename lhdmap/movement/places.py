"""From names to states: where a route starts or ends, with which headings, and what it is to avoid."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.movement.rules import STANDING_AGAINST, STANDING_ALONG, STATE_COUNT, STATES
from lhdmap.movement.search import Indices
from lhdmap.movement.ways import Bools, Ways, arms_of
from lhdmap.settings import nearest
from lhdmap.topology.model import AccessPoint, Point, TopologicalMap, Waypoint


@dataclass(frozen=True)
class Place:
    """A start or a goal: its `name`, and the points that it may be (indices), each with the headings allowed (+1, -1)."""

    name: str
    headings: dict[int, tuple[int, ...]]

    def standing(self, heading: int | None = None) -> Indices:
        """Return the states of a machine that stands there; with one heading only, where it is given."""
        return np.array(
            [
                STATE_COUNT * point + (STANDING_ALONG if one > 0 else STANDING_AGAINST)
                for point, allowed in self.headings.items()
                for one in allowed
                if heading in (None, one)
            ],
            dtype=np.int64,
        )

    def arrivals(self) -> Indices:
        """Return all states, moving ones among them, with an allowed heading."""
        return np.array(
            [
                STATE_COUNT * point + k
                for point, allowed in self.headings.items()
                for k, state in enumerate(STATES)
                if state.heading in allowed
            ],
            dtype=np.int64,
        )


def place(topology: TopologicalMap, name: str, heading: str | None, option: str = "--heading") -> Place:
    """Return the place that a name or id of a point or of a node means; a node: any of its points.

    `heading`: `along` or `against` that of the point, or degrees in the frame of the map; None: both.

    Raises:
        UsageError: nothing has that name, the node has no points, or the heading is none.
    """
    found = topology.called(name)
    if found is None:
        raise UsageError(f"the map has no '{name}'{nearest(name, topology.names())}")
    points = [found] if isinstance(found, (AccessPoint, Waypoint)) else topology.points_of(found.id)
    if not points:
        raise UsageError(f"'{name}' has no access point and no waypoint: nothing leads there")
    index = {one: k for k, one in enumerate(topology.points)}
    return Place(name, {index[one.id]: _headings(one, heading, option) for one in points})


def _headings(point: Point, heading: str | None, option: str) -> tuple[int, ...]:
    if heading is None:
        return (1, -1)
    if heading in ("along", "against"):
        return (1,) if heading == "along" else (-1,)
    try:
        turn_rad = math.radians(float(heading)) - float(point.pose[3])
    except ValueError:
        turn_rad = math.nan
    if not math.isfinite(turn_rad):
        raise UsageError(f"{option} {heading}: along, against or degrees were wanted")
    return (1,) if math.cos(turn_rad) >= 0.0 else (-1,)


def avoided_ways(topology: TopologicalMap, ways: Ways, names: Iterable[str]) -> Bools:
    """Return which ways (W,) the names take out: those of a point, of a node, or between the two of `A:B`.

    Of a node also those that lead to it within its neighbours: who inverts there would stand in it.

    Raises:
        UsageError: a name is unknown, or nothing joins the two.
    """
    index = {one: k for k, one in enumerate(topology.points)}
    avoided = np.zeros(len(ways.start), dtype=bool)
    for name in names:
        both = [name] if topology.called(name) is not None else _pair(topology, name)
        ends = [np.isin(ends, points) for one in both for points in [_points(topology, index, one)]
                for ends in (ways.start, ways.end)]  # fmt: skip
        if len(both) == 1:
            node = getattr(topology.called(name), "id", name)
            arms = [index[one] for one in arms_of(topology, {node})]
            avoided |= ends[0] | ends[1] | np.isin(ways.start, arms) | np.isin(ways.end, arms)
            continue
        joined = (ends[0] & ends[3]) | (ends[1] & ends[2])
        if not joined.any():
            raise UsageError(f"--avoid {name}: nothing joins {both[0]} and {both[1]}")
        avoided |= joined
    return avoided


def _pair(topology: TopologicalMap, name: str) -> list[str]:
    """Return the two names of `A:B`, whichever colon parts them."""
    parts = name.split(":")
    splits = [(":".join(parts[:k]), ":".join(parts[k:])) for k in range(1, len(parts))]
    for split in splits:
        if all(topology.called(one) is not None for one in split):
            return list(split)
    unknown = next((one for one in (splits[0] if splits else [name]) if topology.called(one) is None), name)
    raise UsageError(f"--avoid {name}: the map has no '{unknown}'{nearest(unknown, topology.names())}")


def _points(topology: TopologicalMap, index: dict[str, int], name: str) -> Sequence[int]:
    found = topology.called(name)
    if isinstance(found, (AccessPoint, Waypoint)):
        return [index[found.id]]
    return [] if found is None else [index[one.id] for one in topology.points_of(found.id)]
