"""Rays against meshes by Embree (inside open3d), and the part of a long drift that a machine in it can see."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.extras import library
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.drift import Mesh

MeshBetween = Callable[[float, float], Mesh]


class Surface:
    """A mesh to cast rays against; `origin_m` (3,) in `map` is near it, so that float32 coordinates stay exact."""

    def __init__(self, mesh: Mesh) -> None:
        o3d = library("open3d")

        self.origin_m: FloatArray = np.round(mesh.vertices_m.mean(axis=0))
        core: Any = o3d.core  # its stubs know no array
        self._tensor = core.Tensor
        self._scene: Any = o3d.t.geometry.RaycastingScene(nthreads=1)
        vertices = (mesh.vertices_m - self.origin_m).astype(np.float32)
        self._scene.add_triangles(self._tensor(vertices), self._tensor(np.ascontiguousarray(mesh.triangles)))

    def cast(self, rays: Float32Array) -> Float32Array:
        """Return the range of each ray, shape (N,), metres, inf for none.

        `rays`, shape (N, 6): origin less `origin_m`, and unit direction.
        """
        return self._scene.cast_rays(self._tensor(rays), nthreads=1)["t_hit"].numpy()

    def crossings(self, rays: Float32Array) -> npt.NDArray[np.int64]:
        """Return how many surfaces each ray crosses, shape (N,); `rays` as for `cast`."""
        return self._scene.count_intersections(self._tensor(rays), nthreads=1).numpy()


class Layered:
    """Several surfaces as one: a large one that stays, and small ones that come and go."""

    def __init__(self, base: Surface, others: list[Surface]) -> None:
        self._base, self._others = base, others
        self.origin_m = base.origin_m

    def cast(self, rays: Float32Array) -> Float32Array:
        """Return the range of each ray, as `Surface.cast`."""
        ranges = self._base.cast(rays)
        for other in self._others:
            moved = rays.copy()
            moved[:, :3] += (self.origin_m - other.origin_m).astype(np.float32)
            ranges = np.minimum(ranges, other.cast(moved))
        return ranges


class TiledSurface:
    """The surface around a place of a long drift; it is renewed as the machine drives on, so memory does not grow."""

    def __init__(self, mesh_between: MeshBetween, reach_m: float, *, tile_m: float = 40.0) -> None:
        """`mesh_between(s0, s1)` meshes the drift between two arc lengths; `reach_m` is how far rays go.

        The surface is renewed when the machine comes from one stretch of `tile_m` into the next.
        """
        self._mesh_between, self._reach_m, self._tile_m = mesh_between, reach_m, tile_m
        self._tile: int | None = None
        self._surface: Surface | None = None

    def near(self, s_m: float) -> Surface:
        """Return the surface that a scanner at arc length `s_m` can see."""
        tile = math.floor(s_m / self._tile_m)
        if self._surface is None or tile != self._tile:
            self._surface = None  # the old one must go before the new one takes its memory
            start_m, end_m = tile * self._tile_m - self._reach_m, (tile + 1) * self._tile_m + self._reach_m
            self._surface, self._tile = Surface(self._mesh_between(start_m, end_m)), tile
        return self._surface
