"""From a path of states to the steps of a route: where the machine stops, changes gear and turns, and when."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.movement.costs import Pace
from lhdmap.movement.movement_map import TURN
from lhdmap.movement.profile import run_times
from lhdmap.movement.route import Gear, Step
from lhdmap.movement.rules import NAMES, STATE_COUNT, STATES, State
from lhdmap.movement.search import Indices
from lhdmap.movement.ways import Ints, Ways
from lhdmap.topology.model import Point, TopologicalMap, Waypoint


@dataclass(frozen=True)
class Sequence:
    """States (n,) in a row and the way (n - 1,) between each and the next: index of a way, or TURN."""

    states: Indices
    ways: Ints

    def stopped(self) -> Sequence:
        """Return it with a stop at its end: the paper adds the goal as a state of its own."""
        last = int(self.states[-1])
        state = STATES[last % STATE_COUNT]
        if state.motion == 0:
            return self
        stop = last - last % STATE_COUNT + STATES.index(State(0, state.heading))
        return Sequence(np.append(self.states, stop), np.append(self.ways, np.int32(TURN)))


def steps_of(topology: TopologicalMap, ways: Ways, pace: Pace, sequence: Sequence) -> tuple[Step, ...]:
    """Return the steps of a sequence of states that begins and ends standing."""
    ids = list(topology.points)
    points = [topology.points[ids[int(state) // STATE_COUNT]] for state in sequence.states]
    names = [NAMES[int(state) % STATE_COUNT] for state in sequence.states]
    gears, stops = _gears(sequence.states), [name in ("v", "vi") for name in names]
    inversion, turn = _stops(sequence, stops)
    waits = [pace.inversion_s * changes + pace.turn_s * turns for changes, turns in zip(inversion, turn, strict=True)]
    spent = _spent(ways, pace, sequence, gears, stops, [_cap_mps(point) for point in points])
    at_s = accumulate((wait + drive for wait, drive in zip(waits, spent, strict=False)), initial=0.0)
    at_m = accumulate(_lengths(ways, sequence.ways).tolist(), initial=0.0)
    leaving = [*gears, *(gears[-1:] or [1])]
    told: list[Gear] = ["reverse" if gear < 0 else "forward" for gear in leaving]
    columns = (names, points, told, stops, at_m, at_s, inversion, turn)
    return tuple(
        Step(point.id, name, point.node, gear, stop, length, time, changes, turns)
        for name, point, gear, stop, length, time, changes, turns in zip(*columns, strict=True)
    )


def _cap_mps(point: Point) -> float:
    """Return the highest speed at which a point is passed, m/s."""
    return point.speed_limit_kmh / 3.6 if isinstance(point, Waypoint) and point.speed_limit_kmh > 0.0 else math.inf


def _gears(states: Indices) -> list[int]:
    """Return the gear of each piece (n - 1,): that of a moving state at either end; from stop to stop, the next piece's."""
    own = [STATES[int(state) % STATE_COUNT].gear for state in states]
    gears = [before or after for before, after in pairwise(own)]
    for order in (range(len(gears) - 2, -1, -1), range(1, len(gears))):
        for k in order:
            if gears[k] == 0:
                gears[k] = gears[k + 1] if order.step < 0 else gears[k - 1]
    return gears


def _stops(sequence: Sequence, stops: list[bool]) -> tuple[list[bool], list[bool]]:
    """Return at which states the gear changes, and at which the machine turns round."""
    own = [STATES[int(state) % STATE_COUNT].gear for state in sequence.states]
    inversion, turn = [False] * len(own), [False] * len(own)
    came = 0
    for k, gear in enumerate(own):
        leaves = k + 1 < len(own) and own[k + 1] != 0
        if stops[k] and leaves and came and own[k + 1] != came:
            inversion[k] = True
        points = sequence.states[k : k + 2] // STATE_COUNT
        turn[k] = stops[k] and len(points) == 2 and bool(points[0] == points[1])
        came = gear or came
    return inversion, turn


def _lengths(ways: Ways, way: Ints) -> FloatArray:
    lengths: FloatArray = np.where(way == TURN, 0.0, ways.length_m[way]) if len(way) else np.zeros(0)
    return lengths


def _spent(
    ways: Ways, pace: Pace, sequence: Sequence, gears: list[int], stops: list[bool], caps_mps: list[float]
) -> list[float]:
    """Return the time on each piece (n - 1,), run by run between stops; `caps_mps` (n,): how fast each point is passed at most."""
    lengths = _lengths(ways, sequence.ways).tolist()
    limits = np.where(sequence.ways == TURN, np.inf, ways.limit_mps[sequence.ways]) if gears else np.zeros(0)
    speeds = pace.speed_mps(limits, np.array(gears, dtype=np.int8)).tolist()
    spent: list[float] = []
    begin = 0
    for k in range(1, len(stops)):
        if stops[k]:
            spent += run_times(lengths[begin:k], speeds[begin:k], pace, caps_mps[begin + 1 : k])
            begin = k
    return spent
