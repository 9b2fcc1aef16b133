"""Single things as meshes: rocks, another machine, posts. Each in its own frame, metres."""

from __future__ import annotations

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh, Triangles

_RINGS, _SECTORS = 15, 24
_BUCKET_LIP_M = 1.0  # how far the bucket's floor reaches before its upper edge


def rock(size_m: float, rng: np.random.Generator) -> Mesh:
    """Return an angular rock around the origin whose largest extent is `size_m`: an uneven ellipsoid, turned at random."""
    polar = np.linspace(0.0, np.pi, _RINGS)[:, None]
    azimuth = np.linspace(0.0, 2 * np.pi, _SECTORS, endpoint=False)
    unit = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth], axis=-1
    )
    facets = rng.standard_normal((12, 3))
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    cut = rng.uniform(0.8, 0.98, 12)
    facing = np.maximum(unit @ facets.T, 1e-6)
    radius = np.minimum(1.0, (cut / facing).min(axis=-1))  # flat where a facet cuts the ball off
    points = (unit * radius[..., None]).reshape(-1, 3) * rng.uniform(0.7, 1.0, 3)
    points = points @ _turn(rng).T
    return Mesh(points * size_m / extent(points), _ball_triangles())


def extent(points_m: FloatArray) -> float:
    """Return the largest distance between two of the points, shape (N, 3)."""
    difference = points_m[:, None] - points_m[None]
    return float(np.sqrt((difference**2).sum(axis=-1).max()))


def _turn(rng: np.random.Generator) -> FloatArray:
    """Return a random rotation matrix (3, 3)."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    turned: FloatArray = q * np.sign(np.diag(r))
    return turned


def _ball_triangles() -> Triangles:
    ring = np.arange(_RINGS - 1)[:, None] * _SECTORS
    here = np.arange(_SECTORS)
    after = (here + 1) % _SECTORS
    a, b = (ring + here).ravel(), (ring + after).ravel()
    pairs = [np.stack([a, b, a + _SECTORS], axis=1), np.stack([b, b + _SECTORS, a + _SECTORS], axis=1)]
    return np.concatenate(pairs).astype(np.uint32)


def box(low_m: FloatArray, high_m: FloatArray) -> Mesh:
    """Return an axis-aligned box between two corners."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    return Mesh(low_m + corners * (high_m - low_m), _BOX)


_BOX: Triangles = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.uint32,
)  # fmt: skip


def standing_machine(machine: Machine) -> list[Mesh]:
    """Return a straight machine in the frame of its base_link: its bodies, the bucket's mouth as a slope."""
    parts = []
    for name, body in machine.bodies.items():
        shift = np.array([-machine.dimensions.wheelbase_m if body.frame == "rear_link" else 0.0, 0.0, 0.0])
        lift = np.array([0.0, 0.0, 0.45 if "frame" in name else 0.0])  # there is air under the frames
        low, high = np.array(body.min_m), np.array(body.max_m)
        part = box(np.maximum(low, lift) * [0, 0, 1] + low * [1, 1, 0] + shift, high + shift)
        parts.append(_bucket(part) if "bucket" in name else part)
    parts += [_wheel(machine, x, side) for x in (0.0, -machine.dimensions.wheelbase_m) for side in (-1.0, 1.0)]
    return parts


def _bucket(part: Mesh) -> Mesh:
    """Return the box with its upper front edge drawn back, so that its front is a slope like a full bucket's."""
    vertices = part.vertices_m.copy()
    front_top = (vertices[:, 0] > vertices[:, 0].mean()) & (vertices[:, 2] > vertices[:, 2].mean())
    vertices[front_top, 0] -= _BUCKET_LIP_M
    return Mesh(vertices, part.triangles)


def _wheel(machine: Machine, x_m: float, side: float) -> Mesh:
    radius, middle = machine.dimensions.wheel_radius_m, 0.5 * side * machine.dimensions.track_m
    return cylinder(np.array([x_m, middle, radius]), np.array([0.0, 0.5, 0.0]), radius)


def cylinder(middle_m: FloatArray, axis_m: FloatArray, radius_m: float, sides: int = 20) -> Mesh:
    """Return an open cylinder around `middle_m` whose length is that of `axis_m`, both (3,)."""
    direction = axis_m / np.linalg.norm(axis_m)
    across = np.cross(direction, [1.0, 0.0, 0.0] if abs(direction[0]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)[:, None]
    ring = radius_m * (np.cos(angle) * across + np.sin(angle) * np.cross(direction, across))
    here = np.arange(sides)
    after = (here + 1) % sides
    walls = [np.stack([here, after, here + sides], axis=1), np.stack([after, after + sides, here + sides], axis=1)]
    vertices = np.concatenate([middle_m - 0.5 * axis_m + ring, middle_m + 0.5 * axis_m + ring])
    return Mesh(vertices, np.concatenate(walls).astype(np.uint32))
