"""Contact of the bodies against brute force: walls and obstacles as dense points, against the boxes of random poses."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt
import pytest
from lhdmap.geometry import se3
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.vehicle.bodies import Bodies, Boxes, body_boxes, bucket_outline
from lhdmap.simulation.vehicle.contact import ContactPiece, Contacts, is_flat
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.vehicle import Vehicle
from scipy.ndimage import gaussian_filter

from tests.simulation.vehicle.grounds import Plane

SPACING_M = 0.012
MISS_M = 0.01
ORIGIN = np.array([4_000.0, -2_500.0, -310.0])
Indices = npt.NDArray[np.int64]


class Mesh(NamedTuple):
    vertices_m: FloatArray
    triangles: Indices


def rough_tunnel(rng: np.random.Generator) -> Mesh:
    """15 m of walls and roof in triangles of 0.1 to 0.15 m, rough by 8 cm, about 4 m wide and 3.4 m high."""
    s, u = np.meshgrid(np.arange(-9.0, 6.0, 0.12), np.linspace(0.0, 1.0, 90), indexing="ij")
    rough = sum(gaussian_filter(rng.standard_normal(s.shape), k) * k * size for k, size in ((1.0, 0.08), (4.0, 0.2)))
    angle = math.pi * u
    reach = 1.0 + np.asarray(rough) / 2.0
    y = -2.1 * np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.4 * reach
    z = 3.4 * np.sin(angle) ** 0.6 * reach
    index = np.arange(s.size).reshape(s.shape)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([s, y, z], axis=-1).reshape(-1, 3) + ORIGIN, triangles)


def large_triangles(rng: np.random.Generator) -> Mesh:
    """Plates and needles of metres that stand about in the tunnel."""
    middle = rng.uniform((-8.0, -2.0, 0.2), (5.0, 2.0, 3.0), (6, 1, 3))
    corners = middle + rng.normal(0.0, (0.6, 0.1, 0.6), (6, 3, 3))
    return Mesh(corners.reshape(-1, 3) + ORIGIN, np.arange(18).reshape(-1, 3))


class Dense(NamedTuple):
    """Points on each triangle, corners and edges too: none of it is farther than MISS_M from one; `first` of each triangle."""

    points_m: FloatArray
    first: Indices
    middle_m: FloatArray
    radius_m: FloatArray


def dense(mesh: Mesh) -> Dense:
    corners = mesh.vertices_m[mesh.triangles]
    longest = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1)
    points = [_spread(one, math.ceil(length / SPACING_M)) for one, length in zip(corners, longest, strict=True)]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    return Dense(np.concatenate(points), np.cumsum([0, *map(len, points)]), middle, radius)


def _spread(corners: FloatArray, n: int) -> FloatArray:
    i, j = np.mgrid[: n + 1, : n + 1]
    u, v = i[i + j <= n] / n, j[i + j <= n] / n
    return np.stack([1.0 - u - v, u, v], axis=1) @ corners


@nb.njit(cache=True)
def outside_and_inside(
    point: FloatArray, centre: FloatArray, axes: FloatArray, half: FloatArray
) -> tuple[float, float]:
    """Return how far a point is from a box, and how deep in it (below 0: not)."""
    outside, inside = 0.0, np.inf
    x, y, z = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    for k in range(3):
        over = abs(axes[0, k] * x + axes[1, k] * y + axes[2, k] * z) - half[k]
        outside += max(over, 0.0) ** 2
        inside = min(inside, -over)
    return outside**0.5, inside


@nb.njit(cache=True)
def brute(cloud: Dense, centres: FloatArray, axes: FloatArray, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return for each box the least distance of the points from it (1 m at the most), and how deep the deepest is in it."""
    distance, depth = np.full(len(centres), 1.0), np.full(len(centres), -np.inf)
    apart = np.empty(len(cloud.middle_m))
    for b in range(len(centres)):
        reach = 1.0
        for t in range(len(apart)):
            apart[t], _ = outside_and_inside(cloud.middle_m[t], centres[b], axes[b], half[b])
            reach = min(reach, apart[t])  # a triangle's middle is one of its points
        for t in range(len(apart)):
            if apart[t] - cloud.radius_m[t] > min(distance[b], reach):
                continue
            for p in range(cloud.first[t], cloud.first[t + 1]):
                outside, inside = outside_and_inside(cloud.points_m[p], centres[b], axes[b], half[b])
                distance[b], depth[b] = min(distance[b], outside), max(depth[b], inside)
    return distance, depth


def random_state(rng: np.random.Generator) -> VehicleState:
    still = Vehicle(Machine(), Plane()).at_rest(0.0, 0.0, 0.0, near_z_m=0.0, time_ns=0)
    x, y, z = ORIGIN + rng.uniform((-1.0, -0.5, 0.0), (2.0, 0.5, 0.3))
    roll, pitch, yaw, bend = rng.uniform(-1.0, 1.0, 4) * (0.05, 0.05, 0.15, 0.3)
    boom = 0.0 if rng.random() < 0.75 else rng.uniform(0.0, 1.2)
    turned = still._replace(x_m=x, y_m=y, z_m=z, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw, articulation_rad=bend)
    return turned._replace(boom_rad=boom, bucket_rad=rng.uniform(-1.8, 0.0))


def test_a_thousand_poses_in_a_rough_tunnel() -> None:
    """No contact over 1 cm is missed, none is told where there is more than 1 cm free, clearance is right to 1 cm."""
    rng = np.random.default_rng(5)
    walls, plates = rough_tunnel(rng), large_triangles(rng)
    half = len(walls.triangles) // 2
    pieces = [ContactPiece(walls.vertices_m, part) for part in (walls.triangles[:half], walls.triangles[half:])]
    world = Contacts([*pieces, ContactPiece(*plates)])
    bare = Contacts(pieces)
    wall_points, plate_points = dense(walls), dense(plates)
    bodies = Bodies(Machine())
    free = touched = 0
    for k in range(1000):
        boxes = bodies.boxes(random_state(rng))
        distance, depth = brute(wall_points, *boxes[1:])
        with_plates = k % 2 == 0
        if with_plates:
            more = brute(plate_points, *boxes[1:])
            distance, depth = np.minimum(distance, more[0]), np.maximum(depth, more[1])
        contacts = world if with_plates else bare
        found = {contact.body: contact for contact in contacts.touching(boxes)}
        for name, apart, deep in zip(boxes.names, distance, depth, strict=True):
            assert name in found or deep <= MISS_M
            assert name not in found or apart <= MISS_M
            touched += name in found
            if name in found:
                assert deep - 1e-3 <= found[name].depth_m <= max(deep, 0.0) + MISS_M
        clearance = contacts.clearance_m(boxes)
        least = distance.min()
        assert least - MISS_M <= clearance <= least + 1e-4
        assert (clearance == 0.0) == bool(found)
        free += clearance > 0.0
    assert free > 200, free
    assert touched > 300, touched


def box_at(centre: tuple[float, float, float], half: tuple[float, float, float], yaw_rad: float = 0.0) -> Boxes:
    T = se3.from_rpy(0.0, 0.0, yaw_rad, centre)
    return Boxes(("box",), T[None, :3, 3].copy(), T[None, :3, :3].copy(), np.array([half]))


def plate(corners: list[tuple[float, float, float]]) -> Contacts:
    count = len(corners)
    return Contacts([ContactPiece(np.array(corners), np.array([(0, k, k + 1) for k in range(1, count - 1)]))])


@pytest.mark.parametrize("gap", [-0.3, -0.01, 0.001, 0.25, 0.7])
def test_a_flat_wall(gap: float) -> None:
    wall = plate([(-20.0, 0.0, -1.0), (20.0, 0.0, -1.0), (20.0, 0.0, 5.0), (-20.0, 0.0, 5.0)])
    boxes = box_at((0.3, -1.0 - gap, 1.0), (2.0, 1.0, 0.8))
    found = wall.touching(boxes)
    assert wall.clearance_m(boxes) == pytest.approx(max(gap, 0.0), abs=1e-4)
    assert [round(one.depth_m, 3) for one in found] == ([-gap] if gap < 0.0 else [])
    assert all(abs(one.point_m[1]) < 1e-4 and one.body == "box" for one in found)


def test_a_corner_of_the_box_over_the_middle_of_a_triangle() -> None:
    wall = plate([(-9.0, 0.0, -9.0), (9.0, 0.0, -9.0), (0.0, 0.0, 9.0)])
    boxes = box_at((0.0, -2.0, 0.0), (1.0, 1.0, 1.0), math.pi / 4)
    assert wall.clearance_m(boxes) == pytest.approx(2.0 - math.sqrt(2.0), abs=1e-4)
    near = box_at((0.0, -1.4, 0.0), (1.0, 1.0, 1.0), math.pi / 4)
    assert wall.clearance_m(near) == 0.0
    assert len(wall.touching(near)) == 1


def test_a_needle_through_the_middle_is_found() -> None:
    needle = plate([(-9.0, 0.0, 0.0), (9.0, 0.0, 0.0), (9.0, 0.001, 0.0)])
    (contact,) = needle.touching(box_at((0.0, 0.0, 0.1), (1.0, 1.0, 1.0)))
    assert contact.depth_m == pytest.approx(0.9, abs=0.01)


def test_what_is_farther_than_the_limit_is_the_limit() -> None:
    wall = plate([(-2.0, 0.0, -1.0), (2.0, 0.0, -1.0), (0.0, 0.0, 5.0)])
    assert wall.clearance_m(box_at((0.0, -3.0, 1.0), (1.0, 1.0, 1.0)), 0.5) == 0.5
    assert Contacts([]).clearance_m(box_at((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), 0.7) == 0.7
    assert (
        Contacts([ContactPiece(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))]).touching(box_at((0, 0, 0), (1, 1, 1)))
        == []
    )


def test_floors_do_not_count_but_steep_triangles_of_them_do() -> None:
    vertices = np.array([(-5.0, -5.0, 0.0), (5.0, -5.0, 0.0), (0.0, 5.0, 0.0), (0.0, 5.0, 4.0)])
    triangles = np.array([(0, 1, 2), (1, 2, 3)])
    assert is_flat(vertices, triangles).tolist() == [True, False]
    boxes = box_at((0.0, 0.0, 0.5), (1.0, 1.0, 0.6))
    assert len(Contacts([ContactPiece(vertices, triangles)]).touching(boxes)) == 1
    floor = np.array([True, True])
    assert Contacts([ContactPiece(vertices, triangles, floor)]).touching(boxes) == []
    aside = box_at((2.5, 0.0, 0.5), (1.0, 1.0, 0.6))
    assert len(Contacts([ContactPiece(vertices, triangles, floor)]).touching(aside)) == 1


def corners_of(boxes: Boxes, name: str) -> FloatArray:
    k = boxes.names.index(name)
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return boxes.centre_m[k] + (signs * boxes.half_m[k]) @ boxes.axes[k].T


def test_bodies_are_where_their_frames_are() -> None:
    machine = Machine()
    state = random_state(np.random.default_rng(2))._replace(boom_rad=0.0, bucket_rad=0.0)
    base = se3.from_rpy(state.roll_rad, state.pitch_rad, state.yaw_rad, (state.x_m, state.y_m, state.z_m))
    boxes = body_boxes(machine, state)
    for name, body in machine.bodies.items():
        frame = base if body.frame == "base_link" else base @ T_base_rear(state.articulation_rad, machine)
        corners = np.array(np.meshgrid(*zip(body.min_m, body.max_m, strict=True))).reshape(3, -1).T
        wanted = corners @ frame[:3, :3].T + frame[:3, 3]
        assert np.abs(np.sort(corners_of(boxes, name), axis=0) - np.sort(wanted, axis=0)).max() < 1e-9


@pytest.mark.parametrize("boom_rad", [0.0, 0.5, 1.2])
@pytest.mark.parametrize("bucket_rad", [-1.8, -0.83, 0.0])
def test_the_bucket_is_in_its_box(boom_rad: float, bucket_rad: float) -> None:
    machine = Machine()
    low, high = Bodies(machine).corners(boom_rad, bucket_rad)[list(machine.bodies).index("boom_and_bucket")]
    outline = bucket_outline(machine.linkage, boom_rad, bucket_rad)
    assert (outline >= low[::2] - 1e-9).all()
    assert (outline <= high[::2] + 1e-9).all()


def test_the_linkage_is_that_of_the_loading_model() -> None:
    """Raising the boom by 0.5 rad raises the pin by 1.06 m; rolled forward by 0.83 rad the bucket's floor is level."""
    linkage = Machine().linkage
    low, high = bucket_outline(linkage, 0.0, 0.0), bucket_outline(linkage, 0.5, 0.0)
    assert high[0, 1] - low[0, 1] == pytest.approx(1.06, abs=0.01)
    level = bucket_outline(linkage, 0.0, -0.8)
    assert level[1, 1] == pytest.approx(level[2, 1], abs=1e-9)
    assert level[1, 1] == pytest.approx(0.0, abs=0.01)
