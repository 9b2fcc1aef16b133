"""The union of tubes: of each one's surface what lies inside another is cut away, exactly where the surfaces meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Drift, FloorHeight, Mesh, Triangles
from lhdmap.simulation.raycast import Surface

_OVER_FLOOR_M = 0.06
_OVERLAP_M = 0.01  # a cut leaves this much beyond the other surface: seams have no gaps
_UPWARDS = (0.013, 0.007, 1.0)


class Skin(NamedTuple):
    """A mesh of a mine's surface; `floor` (M,) says which triangles are floor."""

    mesh: Mesh
    floor: npt.NDArray[np.bool_]


class Volume:
    """The inside of a stretch of a tube."""

    def __init__(self, drift: Drift, first: int, last: int, floor: FloorHeight) -> None:
        self._floor = floor
        mesh = drift.mesh(first, last, closed=(True, True))
        self._surface = Surface(mesh)
        self.low_m, self.high_m = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)

    def holds(self, points_m: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which points (N, 3) lie inside: a ray upwards crosses the surface an odd number of times.

        What lies on the floor is judged a little above it: the floor is the same in all tubes.
        """
        result = np.zeros(len(points_m), dtype=bool)
        near = np.flatnonzero(((points_m > self.low_m - _OVER_FLOOR_M) & (points_m < self.high_m)).all(axis=1))
        if near.size:
            points = points_m[near]
            points[:, 2] = np.maximum(points[:, 2], self._floor(points) + _OVER_FLOOR_M)
            directions = np.broadcast_to(np.array(_UPWARDS), (len(near), 3))
            rays = np.hstack([points - self._surface.origin_m, directions]).astype(np.float32)
            result[near] = self._surface.crossings(rays) % 2 == 1
        return result

    def between(self, outside_m: FloatArray, inside_m: FloatArray) -> FloatArray:
        """Return where the ways from points outside to points inside, both (N, 3), enter."""
        way = inside_m - outside_m
        length = np.linalg.norm(way, axis=1, keepdims=True)
        direction = way / np.maximum(length, 1e-9)
        rays = np.hstack([outside_m - self._surface.origin_m, direction]).astype(np.float32)
        reached = self._surface.cast(rays)[:, None].astype(float) + _OVERLAP_M
        return outside_m + np.minimum(reached, length) * direction


def skin_of(drift: Drift, first: int, last: int) -> Skin:
    """Return the surface of the rings `first` to `last` (exclusive) of a tube; its own ends are closed."""
    first, last = max(first, 0), min(last, drift.ring_count())
    closed = (first == 0, last == drift.ring_count())
    mesh = drift.mesh(first, last, closed=closed)
    walls = len(drift.profile.u_m)
    points = len(drift.rings(np.array([drift.settings.mesh_m * first]))[0])
    here = np.tile(np.arange(points), last - first - 1)
    quads = here >= walls - 1
    floor = np.zeros(len(mesh.triangles), dtype=bool)
    floor[: 2 * len(quads)] = np.concatenate([quads, quads])
    return Skin(mesh, floor)


def cut(skin: Skin, volumes: Sequence[Volume]) -> Skin:
    """Return a surface without what lies inside other volumes; the floor stays, which is the same in all."""
    for volume in volumes:
        skin = _cut(skin, volume)
    return skin


def _cut(skin: Skin, volume: Volume) -> Skin:
    vertices, triangles = skin.mesh.vertices_m, skin.mesh.triangles
    inside = volume.holds(vertices)
    if not inside.any():
        return skin
    count = inside[triangles].sum(axis=1)
    whole = skin.floor | (count == 0)
    parts: list[Triangles] = [triangles[whole]]
    new: list[FloatArray] = []
    base = len(vertices)
    for corners_in in (1, 2):
        cutting = triangles[~skin.floor & (count == corners_in)]
        if len(cutting):
            made, points = _clipped(cutting, vertices, inside, volume, base)
            parts.append(made)
            new.append(points)
            base += len(points)
    mesh = Mesh(np.concatenate([vertices, *new]), np.concatenate(parts).astype(np.uint32))
    floor = np.zeros(len(mesh.triangles), dtype=bool)
    floor[: int(whole.sum())] = skin.floor[whole]
    return Skin(mesh, floor)


def _clipped(
    triangles: Triangles, vertices: FloatArray, inside: npt.NDArray[np.bool_], volume: Volume, base: int
) -> tuple[Triangles, FloatArray]:
    """Return what is left of triangles with one or with two corners inside, and the new points, indices from `base`."""
    one = bool(inside[triangles[0]].sum() == 1)
    lonely = inside[triangles] if one else ~inside[triangles]
    first = np.argmax(lonely, axis=1)
    turned = np.take_along_axis(triangles, (first[:, None] + np.arange(3)) % 3, axis=1).astype(np.int64)
    a, b, c = turned.T  # a is alone on its side
    count = len(turned)
    if one:
        points = np.concatenate([volume.between(vertices[b], vertices[a]), volume.between(vertices[c], vertices[a])])
        ab, ac = base + np.arange(count), base + count + np.arange(count)
        made = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    else:
        points = np.concatenate([volume.between(vertices[a], vertices[b]), volume.between(vertices[a], vertices[c])])
        ab, ac = base + np.arange(count), base + count + np.arange(count)
        made = np.stack([a, ab, ac], axis=1)
    return made.astype(np.uint32), points


def without_unused(mesh: Mesh) -> Mesh:
    """Return the mesh without vertices that no triangle has."""
    used, index = np.unique(mesh.triangles, return_inverse=True)
    return Mesh(mesh.vertices_m[used], index.reshape(-1, 3).astype(np.uint32))
