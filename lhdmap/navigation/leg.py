"""Legs: a route over the map cut at its stops, each a line for the leading axle in one gear.

The leading axle follows the ways of the map; in reverse it is the rear one, which is ahead of `base_link` by the wheelbase. So
that `base_link` stops at a goal, the leading axle stops a wheelbase beyond it; and where the gear changes at a point, the machine
goes on until the axle that leads next is beyond that point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lhdmap.guidance.directive import path_of
from lhdmap.messages import FloatArray
from lhdmap.movement.route import Route, Step
from lhdmap.navigation.room import room_m
from lhdmap.navigation.settings import NavigationSettings
from lhdmap.topology.model import Connection, TopologicalMap, Tunnel

_BEYOND_M = 14.0
_STEP_M = 0.25
_SMOOTH_STEPS = 4.0  # a metre: the map's lines are straight between points a metre apart
_MACHINE_M = 1.225


@dataclass(frozen=True)
class Target:
    """A point of a leg: its id, its node, where along the path, its pose (4,) in `map`, whether an intersection ends there.

    `start`: the point (id) of the same node that the way to it comes from.
    """

    point: str
    node: str
    at_m: float
    pose: FloatArray
    crossing: bool
    start: str = ""


@dataclass(frozen=True)
class Leg:
    """A drive from one stop to the next: `path` (N, 6) in `map` for the leading axle (`lhdmap.guidance.directive`).

    `stop_m`: along it, for the leading axle; `goal_m`: for the last point itself; `inversion`: the gear changes after it;
    `begin`: the point (id) that it begins at, `begin_m` along it.
    """

    gear: int
    path: FloatArray
    stop_m: float
    goal_m: float
    targets: tuple[Target, ...]
    inversion: bool
    begin: str = ""
    begin_m: float = 0.0


def legs_of(
    topology: TopologicalMap,
    route: Route,
    wheelbase_m: float,
    nose_m: float,
    settings: NavigationSettings,
    *,
    loaded: bool = False,
    away_m: float = 0.0,
) -> list[Leg]:
    """Return the legs of a feasible route; `nose_m`: how far the machine reaches before `base_link`.

    `away_m`: how far from the route's first point the machine is; the first path begins that far before it.
    """
    runs = _runs(route.states)
    return [
        _leg(
            *(topology, run, wheelbase_m, nose_m, settings),
            loaded=loaded,
            inversion=k + 1 < len(runs),
            away_m=away_m if k == 0 else 0.0,
        )
        for k, run in enumerate(runs)
    ]


def _runs(states: Sequence[Step]) -> list[list[Step]]:
    """Return the states from each stop to the next, both included; standing steps at one point are no drive."""
    runs: list[list[Step]] = []
    run: list[Step] = []
    for step in states:
        run.append(step)
        if step.stop and any(_drives(*pair) for pair in pairwise(run)):
            runs.append(run)
            run = [step]
        elif step.stop:
            run = [step]
    return runs


def _drives(a: Step, b: Step) -> bool:
    """Return whether a step is a way within a node: between twins of access points there is none."""
    return a.point != b.point and a.node == b.node


def _leg(
    topology: TopologicalMap,
    run: list[Step],
    wheelbase_m: float,
    nose_m: float,
    settings: NavigationSettings,
    *,
    loaded: bool,
    inversion: bool,
    away_m: float,
) -> Leg:
    gear = 1 if run[0].gear == "forward" else -1
    pieces, limits, weights, targets, along = [], [], [], [], 0.0
    for a, b in pairwise(run):
        if not _drives(a, b):
            continue
        line, connection = _line(topology, a.point, b.point)
        node = topology.nodes[a.node]
        line = _preferred(line, node, settings) if isinstance(node, Tunnel) else line
        limit = min(connection.speed_limit_kmh, getattr(node, "speed_limit_kmh", math.inf))
        pieces.append(line)
        limits.append(np.full(len(line), limit))
        crossing = not isinstance(node, Tunnel)
        weights.append(np.full(len(line), settings.crossing_weight if crossing else 1.0))
        along += float(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).sum())
        targets.append(Target(b.point, a.node, along, topology.points[b.point].pose, crossing, a.point))
    line = np.concatenate(pieces)[:, :2]
    before = _beyond(topology, run[0], -line[1] + line[0], away_m + _BEYOND_M)
    after = _beyond(topology, run[-1], line[-1] - line[-2], _BEYOND_M)
    whole = np.concatenate([(line[0] + before)[::-1], line, line[-1] + after])
    limit = np.concatenate([np.full(len(before), limits[0][0]), *limits, np.full(len(after), limits[-1][-1])])
    weight = np.concatenate([np.full(len(before), weights[0][0]), *weights, np.full(len(after), weights[-1][-1])])
    lead_m = float(np.linalg.norm(np.diff(before, axis=0, prepend=np.zeros((1, 2))), axis=1).sum())
    path = _smooth(path_of(whole, np.minimum(limit, _limit_kmh(gear, settings, loaded=loaded)) / 3.6, weight))
    path[:, 4] = _widened(path[:, 4], settings.crossing_margin_m)
    goal = lead_m + along
    ahead = wheelbase_m if gear < 0 else 0.0
    if inversion and gear > 0:  # the rear axle leads next: it has to be at the point
        ahead = min(wheelbase_m, max(room_m(topology, run[-1], nose_m) - nose_m - settings.room_m, 0.0))
    moved = tuple(replace(one, at_m=lead_m + one.at_m) for one in targets)
    return Leg(gear, path, goal + ahead, goal, moved, inversion, run[0].point, lead_m)


def _limit_kmh(gear: int, settings: NavigationSettings, *, loaded: bool) -> float:
    limit = settings.speed_limit_kmh if gear > 0 else min(settings.speed_limit_kmh, settings.reverse_limit_kmh)
    return min(limit, settings.loaded_limit_kmh) if loaded else limit


def _line(topology: TopologicalMap, start: str, end: str) -> tuple[FloatArray, Connection]:
    """Return the way between two points of a node, in this order."""
    for one in topology.connections:
        if (one.start, one.end) == (start, end):
            return one.line_m, one
    for one in topology.connections:
        if (one.start, one.end) == (end, start):
            return one.line_m[::-1], one
    raise KeyError(f"{start}, {end}: no connection")  # the route has come along it


def _preferred(line: FloatArray, tunnel: Tunnel, settings: NavigationSettings) -> FloatArray:
    """Return a tunnel's line beside the wall that it prefers; its ends stay."""
    if tunnel.wall_preference == "centre" or len(line) < 3:
        return line
    side = 1.0 if tunnel.wall_preference == "left" else -1.0
    along = math.copysign(1.0, float((line[-1] - line[0])[:2] @ (tunnel.line_m[-1] - tunnel.line_m[0])[:2]))
    room = float(np.median(tunnel.half_widths_m[:, 0 if side > 0 else 1]))
    shift = max(room - _MACHINE_M - settings.beside_wall_m, 0.0) * side * along
    way = np.gradient(line[:, :2], axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    far = np.minimum(np.arange(len(line)), np.arange(len(line))[::-1]) / 6.0
    out = line.copy()
    out[:, :2] += (shift * np.clip(far, 0.0, 1.0))[:, None] * np.column_stack([-way[:, 1], way[:, 0]])
    return out


def _beyond(topology: TopologicalMap, step: Step, way: FloatArray, reach_m: float) -> FloatArray:
    """Return how it goes on beyond an end of a leg, as offsets (M, 2): along the tunnel there, else straight."""
    length = max(float(np.linalg.norm(way)), 1e-9)
    unit = way / length
    point = topology.points[step.point]
    joins = getattr(point, "joins", None)
    nodes = [step.node] if joins is None else [step.node, topology.points[joins].node]
    for name in nodes:
        node = topology.nodes.get(name)
        if isinstance(node, Tunnel):
            found = _along(node.line_m[:, :2], point.pose[:2], unit, reach_m)
            if len(found) > 1:
                return _extended(found, unit, reach_m)
    return _extended(np.zeros((0, 2)), unit, reach_m)


def _along(line: FloatArray, place: FloatArray, unit: FloatArray, reach_m: float) -> FloatArray:
    """Return the offsets from a place of a line's points that go on in a direction, for so far along them."""
    off = line - place
    nearest = int(np.linalg.norm(off, axis=1).argmin())
    tangent = line[min(nearest + 1, len(line) - 1)] - line[max(nearest - 1, 0)]
    ordered = off[nearest:] if tangent @ unit > 0.0 else off[nearest::-1]
    ahead = ordered[1:] if len(ordered) > 1 else ordered[:0]
    beyond = np.flatnonzero(ahead @ unit > 0.3) if len(ahead) else np.zeros(0, int)
    if not len(beyond):
        return ahead[:0]
    ahead = ahead[beyond[0] :]
    gone = np.cumsum(np.linalg.norm(np.diff(ahead, axis=0, prepend=np.zeros((1, 2))), axis=1))
    return ahead[gone < reach_m]


def _extended(found: FloatArray, unit: FloatArray, reach_m: float) -> FloatArray:
    """Return offsets that reach as far as wanted, straight where nothing is known."""
    if len(found) >= 2:
        last = found[-1] - found[-2]
        unit = last / max(float(np.linalg.norm(last)), 1e-9)
    begin = found[-1] if len(found) else np.zeros(2)
    reach = float(np.linalg.norm(np.diff(found, axis=0, prepend=np.zeros((1, 2))), axis=1).sum())
    more = np.arange(0.5, max(reach_m - reach, 1.0), 0.5)
    whole: FloatArray = np.concatenate([found, begin + more[:, None] * unit])
    return whole


def _smooth(path: FloatArray) -> FloatArray:
    out = path.copy()
    more = min(round(4 * _SMOOTH_STEPS), len(path) - 1)
    for column in (0, 1):
        padded = np.pad(path[:, column], more, mode="reflect", reflect_type="odd")
        out[:, column] = gaussian_filter1d(padded, _SMOOTH_STEPS, mode="nearest")[more : more + len(path)]
    out[:, 2] = np.unwrap(np.arctan2(np.gradient(out[:, 1]), np.gradient(out[:, 0])))
    return out


def _widened(weight: FloatArray, margin_m: float) -> FloatArray:
    """Return weights (N,) that begin and end a margin before and after the places that they are of."""
    reach = round(margin_m / _STEP_M)
    padded = np.pad(weight, reach, mode="edge")
    widened: FloatArray = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    return widened
