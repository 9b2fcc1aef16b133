"""Where a machine can stand: how near the end of a drift it may come, and its pose at each place."""

from __future__ import annotations

import math

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.place_tubes import place_at
from lhdmap.mine.plan import BLIND, PlacePlan

PILE_BACK_M = 8.0
"""How far before the end of its drift the foot of an untouched pile is; of a short drift at most `PILE_SHARE` of it."""
PILE_SHARE = 0.45
PIT_M = 3.0
"""Length of the open end of a dump."""
_CLEAR_M = 1.2  # between the machine and what it stands before
_CLEAR_OF_PILE_M = {"spill": 4.2}
_CLEAR_OF_A_PILE_M = 2.2  # its face is uneven
_STOP_LOG_M = 0.4


def toe_back_m(length_m: float) -> float:
    """Return how far before the end of a drift the foot of its untouched pile is, metres."""
    return min(PILE_BACK_M, PILE_SHARE * length_m)


def place_end(network: Network, place: PlacePlan) -> tuple[int, float, int]:
    """Return the tube that a place at an end is in, where its end is (m), and the direction (1, -1) towards it."""
    if place.side != "end":
        index = network.tube(place.name)
        return index, network.tubes[index].length_m, 1
    index = network.tube(place.drift)
    at_m = place_at(place, network.tubes[index])
    return index, at_m, 1 if at_m > 0.0 else -1


def kept_free_m(network: Network, tube: int, end_m: float) -> float:
    """Return how far before the end of a tube (at `end_m`) a machine's bumper stops, metres."""
    for place in network.plan.places:
        if place.kind in BLIND or place.kind == "passing_bay" or place_end(network, place)[:2] != (tube, end_m):
            continue
        if place.kind == "draw_point":
            return toe_back_m(network.tubes[tube].length_m) + _CLEAR_OF_PILE_M.get(place.pile, _CLEAR_OF_A_PILE_M)
        if place.kind == "dump":
            return PIT_M + _STOP_LOG_M + 0.5 * _CLEAR_M
    return _CLEAR_M


def overhang_m(machine: Machine, gear: int) -> float:
    """Return how far the machine reaches before its leading axle: the front axle forwards (1), the rear one in reverse (-1)."""
    if gear > 0:
        return max(body.max_m[0] for body in machine.bodies.values() if body.frame == "base_link")
    return -min(body.min_m[0] for body in machine.bodies.values() if body.frame == "rear_link")


def stand_at(network: Network, place: PlacePlan, machine: Machine) -> tuple[int, float, int]:
    """Return where the front axle of a machine at a place is: tube, arc length (m), and the direction that it faces.

    At draw points, dumps and bays it faces their end; where it parks it faces the way out.
    """
    if place.kind in (*BLIND, "passing_bay"):
        drift = network.tube(place.drift)
        return drift, place_at(place, network.tubes[drift]), 1
    tube, end_m, direction = place_end(network, place)
    facing = -direction if place.kind == "park" else direction
    before_m = kept_free_m(network, tube, end_m)
    if facing == direction:
        before_m += overhang_m(machine, 1)
    else:
        before_m += overhang_m(machine, -1) + machine.dimensions.wheelbase_m
    return tube, end_m - direction * before_m, facing


def place_pose(network: Network, place: PlacePlan, machine: Machine) -> FloatArray:
    """Return x, y, z, heading, shape (4,), of `base_link` of a machine at a place."""
    if place.kind in BLIND:
        tube = network.tubes[network.tube(place.name)]
        return tube.pose(tube.length_m)
    tube_index, s_m, facing = stand_at(network, place, machine)
    pose = network.tubes[tube_index].pose(s_m, facing)
    pose[3] = math.remainder(pose[3], 2 * math.pi)
    return pose
