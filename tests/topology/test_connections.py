"""Whether a machine can drive a way: its radius and the room beside it, in corridors of known width."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.topology.connections import Walls, connection, drivable, way_between
from lhdmap.topology.model import Connection, Kind
from lhdmap.topology.reduce import graph_of
from lhdmap.topology.settings import TopologySettings

from tests.topology.drawn import SCALE, World, steps

BODY = drivable(Machine())
NAMES: tuple[str, str, Kind] = ("a", "b", "front_back")
HALF_M = max(float(np.abs(BODY.front_m[:, 1]).max()), float(np.abs(BODY.rear_m[:, 1]).max()))


def walls(width_m: float) -> Walls:
    """Of a corridor along x."""
    way = [(0.0, 0.0), (60.0, 0.0)]
    return Walls(graph_of(World([(way, width_m)]).sheet(), steps(way), SCALE, TopologySettings()))


def along(y_m: float = 0.0) -> FloatArray:
    return np.column_stack([np.linspace(15.0, 50.0, 71), np.full(71, y_m), np.zeros(71)])


def made(way: FloatArray | None, room: Walls | None) -> Connection:
    chord = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]) if way is None else way[[0, -1]]
    return connection(NAMES, way, chord, room, BODY, 10.0)


@pytest.mark.parametrize("width_m", [3.6, 4.6, 6.0])
@pytest.mark.parametrize("y_m", [0.0, 0.4])
def test_the_clearance_of_a_straight_corridor(width_m: float, y_m: float) -> None:
    found = made(along(y_m), walls(width_m))
    assert found.clearance_m == pytest.approx(0.5 * width_m - y_m - HALF_M, abs=0.12)
    assert found.feasible
    assert found.min_radius_m > 1e3
    assert found.length_m == pytest.approx(35.0, abs=0.01)


def test_a_corridor_narrower_than_the_machine_cannot_be_driven() -> None:
    found = made(along(), walls(2.0 * HALF_M - 0.3))
    assert not found.feasible
    assert "touch the wall" in found.reason


def arc(radius_m: float) -> FloatArray:
    """A quarter turn to the left between straights of 10 m."""
    a = np.arange(0.0, 0.5 * math.pi, 0.25 / radius_m)
    turn = np.column_stack([10.0 + radius_m * np.sin(a), radius_m * (1.0 - np.cos(a))])
    s = np.arange(0.25, 10.0, 0.25)
    line = np.vstack(
        [
            np.column_stack([s, np.zeros(len(s))]),
            turn,
            np.column_stack([np.full(len(s), 10.0 + radius_m), radius_m + s]),
        ]
    )
    return np.column_stack([line, np.zeros(len(line))])


@pytest.mark.parametrize("radius_m", [8.0, 12.0, 25.0])
def test_the_radius_of_a_turn(radius_m: float) -> None:
    found = made(arc(radius_m), None)
    assert found.min_radius_m == pytest.approx(radius_m, rel=0.08)
    assert found.feasible is True


def test_a_turn_tighter_than_the_joint_allows() -> None:
    """Least radius of the front axle: (L_f cos γ + L_r) / sin γ."""
    size = Machine().dimensions
    gamma = math.radians(size.max_articulation_deg)
    least = (size.joint_to_front_axle_m * math.cos(gamma) + size.joint_to_rear_axle_m) / math.sin(gamma)
    assert BODY.least_radius_m == pytest.approx(least)
    found = made(arc(0.6 * least), None)
    assert not found.feasible
    assert found.reason.startswith("radius")


def test_no_way_without_a_loop() -> None:
    found = made(None, None)
    assert not found.feasible
    assert found.length_m == 5.0
    assert "loop" in found.reason


def test_a_way_between_two_poses_begins_and_ends_there() -> None:
    start, end = np.array([0.0, 0.0, 1.0, 0.0]), np.array([12.0, 10.0, 1.0, 0.5 * math.pi])
    way = way_between(start, end)
    assert way is not None
    assert np.allclose(way[0, :2], start[:2], atol=1e-6)
    assert np.allclose(way[-1, :2], end[:2], atol=1e-6)
    first, last = way[1] - way[0], way[-1] - way[-2]
    assert abs(math.atan2(first[1], first[0])) < 0.05
    assert abs(math.remainder(math.atan2(last[1], last[0]) - end[3], 2 * math.pi)) < 0.05


def test_outside_the_sheet_there_is_no_room() -> None:
    assert walls(4.6).clearance_m(np.array([[1e3, 0.0]])) == -math.inf
