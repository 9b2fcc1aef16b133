"""What bodies touch: looked at only where the room that they had may be used up, and never missed by that."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.mine_world.bumper import Bumper
from lhdmap.simulation.vehicle.bodies import Bodies, moved_at_most_m
from lhdmap.simulation.vehicle.vehicle import Vehicle

from tests.simulation.vehicle.grounds import Plane

MACHINE = Machine()
START = Vehicle(MACHINE, Plane()).at_rest(25.0, 0.0, 0.0, near_z_m=0.0, time_ns=0)


class Wall:
    """A world that is one wall 2.3 m to the left."""

    version, surveyed = 0, False

    def keys_in(self, _box_m: FloatArray) -> list[int]:
        return [0]

    def solid(self, _key: int) -> tuple[Mesh, None]:
        corners = np.array([[0.0, 2.3, -1.0], [60.0, 2.3, -1.0], [60.0, 2.3, 5.0], [0.0, 2.3, 5.0]])
        return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)), None


def test_what_is_touched_is_the_same_with_and_without_a_look_at_the_room() -> None:
    looks, always = (Bumper(MACHINE, Wall()) for _ in range(2))  # type: ignore[arg-type]  # as much of a world as it asks for
    touched = []
    for k in range(60):
        turned = math.radians(0.5 * k)
        state = START._replace(x_m=25.0 + 0.02 * k, y_m=0.03 * k, yaw_rad=turned, boom_rad=START.boom_rad + 0.005 * k)
        if k % 10 == 0:
            looks.clearance_m(state)
        said = [[(one.body, one.depth_m) for one in bumper.touching(state)] for bumper in (looks, always)]
        assert said[0] == said[1]
        touched.append(bool(said[0]))
    assert not touched[0]
    assert touched[-1]


def test_no_point_of_a_body_moves_farther_than_is_told() -> None:
    rng, bodies = np.random.default_rng(4), Bodies(MACHINE)
    before = bodies.boxes(START)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    for _ in range(50):
        move = rng.normal(0.0, 0.1, 5)
        now = bodies.boxes(
            START._replace(
                x_m=25.0 + move[0],
                yaw_rad=move[1],
                roll_rad=move[2],
                articulation_rad=move[3],
                boom_rad=START.boom_rad + abs(move[4]),
            )
        )
        for b in range(len(now.names)):
            share = corners * now.half_m[b]
            old = before.centre_m[b] + np.clip(share, -before.half_m[b], before.half_m[b]) @ before.axes[b].T
            moved = np.linalg.norm(now.centre_m[b] + share @ now.axes[b].T - old, axis=1)
            assert moved.max() <= moved_at_most_m(before, now) + 1e-9
