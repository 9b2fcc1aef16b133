"""Rays against the drift: the mesh near the machine in an Embree scene, renewed as the machine drives on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.drift import Mesh

_TILE_M = 40.0
MeshBetween = Callable[[float, float], Mesh]


class TiledScene:
    """Casts rays against the part of a long mesh that scanners at a place can see; memory does not grow with length."""

    def __init__(self, mesh_between: MeshBetween, reach_m: float) -> None:
        """`mesh_between(s0, s1)` gives the mesh between two arc lengths; `reach_m` is how far from the machine rays go."""
        self._mesh_between, self._reach_m = mesh_between, reach_m
        self._tile: int | None = None
        self._scene: Any = None
        self._origin_m = np.zeros(3)

    def origin_m(self, s_m: float) -> FloatArray:
        """Return the origin (3,) in `map` that rays near arc length `s_m` must be given in (keeps float32 exact)."""
        self._load(int(np.floor(s_m / _TILE_M)))
        return self._origin_m

    def cast(self, rays: Float32Array) -> Float32Array:
        """Return the range of each ray, shape (N,), metres, inf for none; `rays` (N, 6) origin and unit direction."""
        import open3d as o3d

        return self._scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)["t_hit"].numpy()

    def _load(self, tile: int) -> None:
        if tile == self._tile:
            return
        import open3d as o3d

        self._scene = None  # the old one must go before the new one takes its memory
        mesh = self._mesh_between(tile * _TILE_M - self._reach_m, (tile + 1) * _TILE_M + self._reach_m)
        self._origin_m = np.round(mesh.vertices_m.mean(axis=0))
        vertices = (mesh.vertices_m - self._origin_m).astype(np.float32)
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(np.ascontiguousarray(mesh.triangles)))
        self._tile = tile
