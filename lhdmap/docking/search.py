"""Hybrid A* with the joint as a state: for aprons that are tight or have things on them (Dolgov et al. 2010).

States are continuous, one for each cell of (x, y, heading, joint, gear); what is left is bounded from below without
obstacles and joint, and tried as a Dubins word now and then.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from lhdmap.docking.connect import Shape, connected, states_of, words_to
from lhdmap.docking.room import Room
from lhdmap.messages import FloatArray

CUSP_M = 12.0
"""Way that a change of gear is worth."""
_CELL_SHARE, _CELL_RAD_PM = 0.5, math.radians(7.5)  # of a stage, and per metre of it
_TRY_EACH, _TRY_WORDS = 5, 2
_EDGE_WEIGHT = 1.3


class _Node(NamedTuple):
    state: FloatArray
    gear: int
    cusps: int
    gone: float
    before: int
    move: tuple[float, float, float]


def searched(
    start: FloatArray, goal: FloatArray, room: Room, shape: Shape, gear: int, limits: tuple[int, int, float]
) -> tuple[FloatArray | None, str]:
    """Return moves (K, 3) from a configuration (4,) to a pose (3,) of the rear axle, or None and why.

    `limits`: changes of gear at most, states that are visited at most, length of a stage (m).
    """
    most_cusps, most_nodes, stage_m = limits
    nodes = [_Node(start, 0, 0, 0.0, -1, (0.0, 0.0, 0.0))]
    queue = [(_least(start, goal, shape), 0)]
    closed: set[tuple[int, ...]] = set()
    bends = (0.0, shape.bend_rad, -shape.bend_rad)
    while queue and len(closed) < most_nodes:
        _, k = heapq.heappop(queue)
        node = nodes[k]
        cell = _cell(node, stage_m)
        if cell in closed:
            continue
        closed.add(cell)
        if len(closed) % _TRY_EACH == 1 and node.cusps + (node.gear == -gear) <= most_cusps:
            moves = _ended(nodes, k, goal, room, shape, gear)
            if moves is not None:
                return moves, ""
        for signed in (gear, -gear):
            cusps = node.cusps + (node.gear == -signed)
            if cusps > most_cusps:
                continue
            for bend in bends:
                move = (float(signed), bend, stage_m)
                way = states_of(node.state, np.array([move]), shape)
                after = _Node(way[-1, :4], signed, cusps, node.gone + stage_m + CUSP_M * (cusps - node.cusps), k, move)
                if _cell(after, stage_m) in closed or not room.free(way):
                    continue
                nodes.append(after)
                heapq.heappush(queue, (after.gone + _EDGE_WEIGHT * _least(after.state, goal, shape), len(nodes) - 1))
    told = "the search ended" if queue else "all that can be reached was searched"
    return None, f"{told} after {len(closed)} states"


def _ended(nodes: list[_Node], k: int, goal: FloatArray, room: Room, shape: Shape, gear: int) -> FloatArray | None:
    """Return the moves to a node and from it to the goal by a word that has room, or None."""
    state = nodes[k].state
    for candidate in words_to(state, goal, gear, shape, np.zeros((0, 3)))[:_TRY_WORDS]:
        moves = connected(candidate, goal, gear, shape)
        if moves is not None and room.free(states_of(state, moves, shape)):
            before = []
            while nodes[k].before >= 0:
                before.append(nodes[k].move)
                k = nodes[k].before
            return np.concatenate([np.array(before[::-1]).reshape(-1, 3), moves])
    return None


def _least(state: FloatArray, goal: FloatArray, shape: Shape) -> float:
    """Return a bound of the way that is left: the distance, or the turning."""
    turned = abs((state[2] - goal[2] + math.pi) % (2.0 * math.pi) - math.pi)
    return max(math.hypot(state[0] - goal[0], state[1] - goal[1]), float(turned) * shape.rear_radius_m)


def _cell(node: _Node, stage_m: float) -> tuple[int, ...]:
    x, y, heading, bend = node.state.tolist()
    size, turn = _CELL_SHARE * stage_m, _CELL_RAD_PM * stage_m
    turned = heading % (2.0 * math.pi)
    return round(x / size), round(y / size), int(turned / turn), round(bend / turn), node.gear, node.cusps
