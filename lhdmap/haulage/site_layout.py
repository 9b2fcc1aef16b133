"""The layout of a site: its checkpoints, and the waypoints of each way between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple, cast

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.haulage.layout import Edge, Layout, Point, Purpose
from lhdmap.haulage.site import Site, SiteArea, SitePlace
from lhdmap.haulage.states import State
from lhdmap.messages import FloatArray
from lhdmap.mine.polyline import rounded_line

_SPACING_M = 1.0  # of waypoints
_RADIUS_M = 10.0  # haulage findings, Section 3: twice the least radius of truck and LHD, or more
_STRAIGHT_M, _S_SHARE = 0.05, 0.25


class _Mouth(NamedTuple):
    """Where an area joins the road: place on its line, pose (x, y, heading into the area)."""

    at_m: float
    pose: FloatArray


def layout_of_site(site: Site) -> Layout:
    """Return the layout of a site, not checked yet (`lhdmap.haulage.layout.checked`).

    Raises:
        ConfigError: an area is too near the end of the road, or to another one, for the turns between them.
    """
    return _Drawing(site).layout()


class _Drawing:
    def __init__(self, site: Site) -> None:
        self.site = site
        points = np.array([[*point, 0.0] for point in site.road.line_m])
        self._road = rounded_line(points, site.road.bend_radius_m, "road")
        self._left = 1.0 if site.keeps == "left" else -1.0
        self._half = 0.5 * site.road.lane_m
        self._reach = site.turn_radius_m + site.road.lane_m
        self._areas = sorted(site.areas, key=lambda one: one.at_m)
        self._mouths = {one.name: self._mouth(one) for one in site.areas}

    def layout(self) -> Layout:
        """Return the layout: lanes, turns and ways in the areas, and the points between them."""
        edges = (*self._roads(), *(edge for area in self._areas for edge in (*self._turns(area), *self._inside(area))))
        names = dict.fromkeys(name for edge in edges for name in (edge.start, edge.end))
        purposes = {
            place.name: (cast("Purpose", place.purpose), area.name) for area in self._areas for place in area.places
        }
        purposes |= {f"{area.name} queue": ("queue", area.name) for area in self._areas}
        points = tuple(Point(name, *purposes.get(name, ("", ""))) for name in names)
        aprons = {
            area.name: np.array([self._in_map(area, corner)[:2] for corner in area.apron])
            for area in self._areas
            if area.apron
        }
        return Layout(self.site.name, points, edges, {area.name: area.role for area in self._areas}, aprons=aprons)

    def _mouth(self, area: SiteArea) -> _Mouth:
        room = self._reach + 1.0
        if not room <= area.at_m <= self._road.length_m - room:
            raise ConfigError(
                f"area '{area.name}' at {area.at_m:g} m: the road is {self._road.length_m:.0f} m long, and turns of "
                f"{self.site.turn_radius_m:g} m want {room:g} m of it on either side"
            )
        x, y, _, heading = self._road.at(np.array([area.at_m]))[0]
        return _Mouth(area.at_m, np.array([x, y, heading + math.copysign(0.5 * math.pi, _sign(area.side))]))

    def _lane(self, from_m: float, to_m: float) -> FloatArray:
        """Return waypoints (N, 3: x, y, heading) of the lane of the direction from one place on the road to another."""
        count = max(int(abs(to_m - from_m) / _SPACING_M), 1) + 1
        rows = self._road.at(np.linspace(from_m, to_m, count))
        heading = rows[:, 3] + (0.0 if to_m >= from_m else math.pi)
        off = self._left * self._half
        return np.column_stack(
            [rows[:, 0] - off * np.sin(heading), rows[:, 1] + off * np.cos(heading), _wrapped(heading)]
        )

    def _roads(self) -> Iterator[Edge]:
        """Yield the stretches of both lanes between the junctions, and those through a junction that has road behind it."""
        for sign, way in ((1, self._areas), (-1, self._areas[::-1])):
            for number, area in enumerate(way):
                at_m, name = area.at_m, _side(sign)
                if 0 < number < len(way) - 1:
                    line = self._lane(at_m - sign * self._reach, at_m + sign * self._reach)
                    start, end = f"{area.name} in {name}", f"{area.name} out {name}"
                    edge = _edge(start, end, State.THROUGH, line, self.site.road.speed_kmh)
                    yield edge._replace(node=f"{area.name} junction")
            for one, other in pairwise(way):
                from_m, to_m = one.at_m + sign * self._reach, other.at_m - sign * self._reach
                if (to_m - from_m) * sign < 1.0:
                    raise ConfigError(
                        f"areas '{one.name}' and '{other.name}': {2 * self._reach + 1:g} m of road between them were wanted"
                    )
                yield from self._stretch(
                    f"{one.name} out {_side(sign)}", f"{other.name} in {_side(sign)}", from_m, to_m
                )

    def _stretch(self, start: str, end: str, from_m: float, to_m: float) -> Iterator[Edge]:
        """Yield a lane between two junctions, cut at checkpoints."""
        road = self.site.road
        count = max(round(abs(to_m - from_m) / road.checkpoint_m), 1) if road.checkpoint_m else 1
        names = [start, *(f"{start} {k}" for k in range(1, count)), end]
        for k, (a, b) in enumerate(pairwise(names)):
            ends = (from_m + (to_m - from_m) * share / count for share in (k, k + 1))
            yield _edge(a, b, State.ROAD, self._lane(*ends), road.speed_kmh)._replace(node=f"{a} to {b}")

    def _turns(self, area: SiteArea) -> Iterator[Edge]:
        """Yield the turns of a T-junction, onto the road and off it, in the directions in which the road goes on."""
        place = self._areas.index(area)
        for sign in (1, -1):
            goes_on = place < len(self._areas) - 1 if sign > 0 else place > 0
            comes = place > 0 if sign > 0 else place < len(self._areas) - 1
            if goes_on:
                end = self._lane(area.at_m, area.at_m + sign * self._reach)[-1]
                yield self._turn(
                    area, f"{area.name} out", f"{area.name} out {_side(sign)}", self._at_mouth(area, 1), end
                )
            if comes:
                begin = self._lane(area.at_m - sign * self._reach, area.at_m)[0]
                yield self._turn(
                    area, f"{area.name} in {_side(sign)}", f"{area.name} in", begin, self._at_mouth(area, -1)
                )

    def _turn(self, area: SiteArea, start: str, end: str, a: FloatArray, b: FloatArray) -> Edge:
        """Return a turn between two poses; it gives way where it crosses the opposing lane: to the side that is not kept to."""
        line = _way(a, b, radius_m=self.site.turn_radius_m)
        turn = math.remainder(b[2] - a[2], 2.0 * math.pi)
        kind = State.JUNCTION_ON if start == f"{area.name} out" else State.JUNCTION_OFF
        edge = _edge(start, end, kind, line, self.site.turn_kmh)
        return edge._replace(area=area.name, gives_way=turn * self._left < 0.0, node=f"{area.name} junction")

    def _at_mouth(self, area: SiteArea, outward: int) -> FloatArray:
        """Return the pose at the mouth, where the way out ends (`outward` 1), or the way in begins (-1)."""
        pose = self._mouths[area.name].pose
        heading = pose[2] + (math.pi if outward > 0 else 0.0)
        return self._in_map(area, (self._reach, 0.0, 0.0))[:3] * np.array([1.0, 1.0, 0.0]) + np.array(
            [-math.sin(heading) * self._left * self._half, math.cos(heading) * self._left * self._half, heading]
        )

    def _in_map(self, area: SiteArea, pose: Sequence[float]) -> FloatArray:
        """Return a pose (x, y, heading rad) of the mouth's frame (heading in degrees) in the map."""
        x, y, heading = self._mouths[area.name].pose
        c, s = math.cos(heading), math.sin(heading)
        turned = heading + math.radians(pose[2]) if len(pose) > 2 else heading
        return np.array([x + c * pose[0] - s * pose[1], y + s * pose[0] + c * pose[1], turned])

    def _inside(self, area: SiteArea) -> Iterator[Edge]:
        """Yield the ways within an area: in, to each place, out again, and past the places."""
        queue, mouth = f"{area.name} queue", self._at_mouth(area, 1)
        at_queue, comes = self._in_map(area, area.queue), self._at_mouth(area, -1)

        def made(edge: Edge, node: str) -> Edge:
            return edge._replace(node=node, area=area.name, speed_kmh=area.speed_kmh)

        yield made(_edge(f"{area.name} in", queue, State.AREA_IN, _way(comes, at_queue)), f"{area.name} in")
        if area.exit:
            line = _way(at_queue, mouth, [self._in_map(area, point) for point in area.exit_by])
            yield made(_edge(queue, f"{area.name} out", State.AREA_OUT, line), f"{area.name} out")
        for place in area.places:
            yield made(self._dock(area, place, at_queue), place.name)
            joins = place.joins == "queue"
            end, name = (at_queue, queue) if joins else (mouth, f"{area.name} out")
            kind = State.AREA_IN if joins else State.AREA_OUT
            way = [self._in_map(area, point) for point in place.out]
            line = _way(self._in_map(area, place.pose), end, way)
            yield made(_edge(place.name, name, kind, line), f"{area.name} in" if joins else f"{area.name} out")

    def _dock(self, area: SiteArea, place: SitePlace, at_queue: FloatArray) -> Edge:
        stands = self._in_map(area, place.pose)
        queue = f"{area.name} queue"
        if place.backup is None:
            return _edge(queue, place.name, State.DOCK, _way(at_queue, stands))
        backup = self._in_map(area, place.backup)
        ahead = _way(at_queue, backup)
        back = _way(stands, backup)[::-1]  # it backs in along the way on which it would drive out
        edge = _edge(queue, place.name, State.DOCK, np.vstack([ahead, back[1:]]))
        return edge._replace(reverse_from_m=_length_m(ahead))


def _edge(start: str, end: str, kind: State, line: FloatArray, speed_kmh: float = 0.0) -> Edge:
    return Edge(start, end, kind, _length_m(line), line_m=line[:, :2], speed_kmh=speed_kmh)


def _length_m(line: FloatArray) -> float:
    return float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())


def _way(a: FloatArray, b: FloatArray, between: Iterable[FloatArray] = (), radius_m: float = _RADIUS_M) -> FloatArray:
    """Return waypoints from a pose to another: straight, by one corner where the headings meet on the way, else by an S."""
    middle = [one[:2] for one in between]
    if not middle:
        corner, gap = _meet(a, b), b[:2] - a[:2]
        if corner is not None and (corner - a[:2]) @ _unit(a[2]) > 0.5 and (b[:2] - corner) @ _unit(b[2]) > 0.5:
            middle = [corner]
        elif abs(float(gap[0] * math.sin(a[2]) - gap[1] * math.cos(a[2]))) > _STRAIGHT_M:
            far = _S_SHARE * float(np.hypot(*gap))
            middle = [a[:2] + far * _unit(a[2]), b[:2] - far * _unit(b[2])]
    return _rounded([a[:2], *middle, b[:2]], radius_m)


def _meet(a: FloatArray, b: FloatArray) -> FloatArray | None:
    """Return where the straight on from pose `a` meets the one that leads to pose `b`; None where they are parallel."""
    u, v = _unit(a[2]), _unit(b[2])
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 1e-3:
        return None
    gap = b[:2] - a[:2]
    return a[:2] + u * float(gap[0] * v[1] - gap[1] * v[0]) / cross


def _rounded(points: Sequence[FloatArray], radius_m: float) -> FloatArray:
    """Return waypoints (N, 2) each metre of the polyline with rounded corners; at its ends a corner may take the whole leg."""
    kept = [points[0]] + [b for a, b in pairwise(points) if np.hypot(*(b - a)) > 0.05]
    first, last = kept[1] - kept[0], kept[-1] - kept[-2]
    more = [float(np.hypot(*leg)) for leg in (first, last)] if len(kept) > 2 else [0.0, 0.0]
    kept[0], kept[-1] = kept[0] - (first if more[0] else 0.0), kept[-1] + (last if more[1] else 0.0)
    line = rounded_line(np.array([[*point, 0.0] for point in kept]), radius_m, "way")
    count = max(int((line.length_m - sum(more)) / _SPACING_M), 1) + 1
    return line.at(np.linspace(more[0], line.length_m - more[1], count))[:, :2]


def _unit(heading_rad: float) -> FloatArray:
    return np.array([math.cos(heading_rad), math.sin(heading_rad)])


def _wrapped(angles: FloatArray) -> FloatArray:
    return np.arctan2(np.sin(angles), np.cos(angles))


def _sign(side: str) -> float:
    return 1.0 if side == "left" else -1.0


def _side(sign: int) -> str:
    return "ahead" if sign > 0 else "back"
