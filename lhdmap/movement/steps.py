"""From a path of states to the steps of a route: where the machine stops, changes gear and turns, and when."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.movement.costs import Pace
from lhdmap.movement.movement_map import TURN
from lhdmap.movement.profile import run_times
from lhdmap.movement.route import Gear, Step
from lhdmap.movement.rules import NAMES, STANDING_ALONG, STATE_COUNT, STATES, State
from lhdmap.movement.search import Indices
from lhdmap.movement.ways import Ints, Ways
from lhdmap.topology.model import TopologicalMap


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
    gears = _gears(sequence.states)
    stops = [int(state) % STATE_COUNT >= STANDING_ALONG for state in sequence.states]
    inversion, turn = _stops(sequence, stops)
    spent_s = _spent(ways, pace, sequence, gears, stops)
    at_s = 0.0
    steps, ids = [], list(topology.points)
    along = np.concatenate([[0.0], np.cumsum(_lengths(ways, sequence.ways))])
    for k, state in enumerate(map(int, sequence.states)):
        at_s += spent_s[k - 1] if k else 0.0
        leaving = gears[k] if k < len(gears) else (gears[-1] if gears else 1)
        gear: Gear = "reverse" if leaving < 0 else "forward"
        point = topology.points[ids[state // STATE_COUNT]]
        name = NAMES[state % STATE_COUNT]
        steps.append(Step(point.id, name, point.node, gear, stops[k], float(along[k]), at_s))
        steps[-1] = replace(steps[-1], inversion=inversion[k], turn=turn[k])
        at_s += pace.inversion_s * inversion[k] + pace.turn_s * turn[k]
    return tuple(steps)


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


def _spent(ways: Ways, pace: Pace, sequence: Sequence, gears: list[int], stops: list[bool]) -> list[float]:
    """Return the time on each piece (n - 1,), run by run between stops."""
    lengths = _lengths(ways, sequence.ways)
    limits = np.where(sequence.ways == TURN, np.inf, ways.limit_mps[sequence.ways]) if len(gears) else np.zeros(0)
    speeds = pace.speed_mps(limits, np.array(gears, dtype=np.int8))
    spent: list[float] = []
    begin = 0
    for k in range(1, len(stops)):
        if stops[k]:
            spent += run_times(lengths[begin:k].tolist(), speeds[begin:k].tolist(), pace)
            begin = k
    return spent
