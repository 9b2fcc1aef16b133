"""A mine whose draw point is dug: the drawn pile becomes a field, scanners see it shrink, bodies may go into it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.machine import Machine
from lhdmap.messages import Command
from lhdmap.simulation.ground.mine import mine_piles
from lhdmap.simulation.ground.vehicle import LoadingVehicle
from lhdmap.simulation.mine_world.world import MineWorld

from tests.mine.plans import TEE, network_of
from tests.simulation.ground.digs import quiet

PLACE = {"drift": "B", "kind": "draw_point", "side": "end", "name": "DP"}


@pytest.fixture(scope="module")
def world() -> MineWorld:
    return MineWorld(network_of(TEE, walls={"mesh_m": 0.25}, place=[PLACE]), Machine())


def seen_m(world: MineWorld, over_m: float = 0.5) -> float:
    """Range of a level ray along drift B to the pile."""
    scene = world.near(np.array([40.0, 30.0, 0.0]))
    z = float(world.floor_height(np.array([[40.0, 30.0, 0.0]]))[0]) + over_m
    ray = np.zeros((1, 6), dtype=np.float32)
    ray[0, :3], ray[0, 4] = np.array([40.0, 30.0, z]) - scene.origin_m, 1.0
    return float(scene.cast(ray)[0])


def test_the_field_is_the_drawn_pile_and_is_dug(world: MineWorld) -> None:
    drawn = seen_m(world)
    piles = mine_piles(world, quiet(rock={"hardness": 1.0, "hardness_sigma": 0.0}), seed=1)
    pile = piles.heaps["DP"]
    assert 40.0 < pile.volume_m3 < 200.0
    vehicle = LoadingVehicle(Machine(), world, piles, seed=1)
    state = vehicle.at_rest(40.0, 35.5, math.pi / 2, near_z_m=0.0, time_ns=0)

    def go(seconds: float, propel: float, tilt: float, *, rpm: bool = False) -> None:
        nonlocal state
        for _ in range(round(seconds * 100)):
            state = vehicle.step(state, Command(state.time_ns, propel, 0.0, tilt, 0.0, rpm, propel == 0.0), 0.01)

    before = pile.volume_m3
    go(5.5, 0.0, -0.8)
    assert seen_m(world) == pytest.approx(drawn, abs=0.35)
    go(6.5, 0.5, 0.0)
    for _ in range(7):
        go(1.0, 0.5, 0.6)
        go(0.7, 0.5, 0.0, rpm=True)
    go(3.0, 0.0, 1.0, rpm=True)
    go(9.0, -0.5, 0.0)
    go(3.0, 0.0, 0.0)
    assert state.load_kg > 3000.0
    rock_m3 = state.load_kg / 2420.0
    assert before + pile.came_m3 - pile.volume_m3 == pytest.approx(rock_m3, abs=0.005)
    assert seen_m(world) > drawn + 0.2


def test_bodies_may_go_into_a_pile_that_is_dug(world: MineWorld) -> None:
    box = np.array([[38.0, 41.0, 0.0], [42.0, 48.0, 2.0]])
    assert not [key for key in world.keys_in(box) if isinstance(key, str)]
