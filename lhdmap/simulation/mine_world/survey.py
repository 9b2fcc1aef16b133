"""A surveyed surface: a mesh, or a cloud that is meshed, in pieces as the generated surface is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.errors import ConfigError, InputError
from lhdmap.extras import library
from lhdmap.integration.cloud_io import READERS, read_cloud
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.plan import SurfacePlan
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.mine_world.collada import read_dae
from lhdmap.simulation.mine_world.hollow import Skin, without_unused
from lhdmap.simulation.raycast import Surface

_CELL_M = 15.0
_STATION_M = 0.5
_EYE_M = 1.2  # floors are looked for from this far above where they are expected
_FLOOR_UP = 0.7  # least share of a floor triangle's normal that points up or down
_FLOOR_M = 1.0  # floor is not higher above the centre line
_AROUND, _STEP_M = 24, 0.25  # triangles of the floor about a place; what is lower above them a wheel climbs
_SAMPLES_MAX = 2_000_000


class SurveyedSkins:
    """The pieces of a surveyed surface, and its floor."""

    def __init__(self, network: Network) -> None:
        plan = network.plan.surface
        mesh = placed(read_surface(plan), plan)
        self._stations = np.concatenate([_stations(network, k) for k in range(len(network.tubes))])
        self._tree = KDTree(self._stations[:, :2])
        self._surface = Surface(mesh)
        self._skins = _split(mesh, self._is_floor(mesh))
        if not self._skins:
            raise ConfigError(f"surface.file = {plan.file}: no triangles were found in it")
        self.boxes_m = np.stack(
            [np.stack([one.mesh.vertices_m.min(axis=0), one.mesh.vertices_m.max(axis=0)]) for one in self._skins]
        )

    def skin(self, index: int) -> Skin:
        """Return the surface of a piece."""
        return self._skins[index]

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height (N,) under points (N, 3); where there is none that of the centre line."""
        rays = np.zeros((len(points_m), 6), dtype=np.float32)
        rays[:, :3] = points_m - self._surface.origin_m
        rays[:, 2] += _EYE_M
        rays[:, 5] = -1.0
        down = self._surface.cast(rays).astype(float)
        height = points_m[:, 2] + _EYE_M - down
        lost = ~(down < 2.0 * _EYE_M + 1.5)
        if lost.any():
            height[lost] = self._stations[self._tree.query(points_m[lost, :2])[1], 2]
        return height

    def _is_floor(self, mesh: Mesh) -> npt.NDArray[np.bool_]:
        """Return which triangles are floor: nearly level and not above the centre lines, or on such and lower than a step."""
        a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        up = np.abs(normal[:, 2]) > _FLOOR_UP * np.linalg.norm(normal, axis=1)
        middle = (a + b + c) / 3.0
        low = middle[:, 2] < self._stations[self._tree.query(middle[:, :2])[1], 2] + _FLOOR_M
        floor: npt.NDArray[np.bool_] = up & low
        if floor.sum() >= _AROUND:  # a survey has noise and stones: their sides are no walls
            rest = np.flatnonzero(low & ~up)
            around = KDTree(middle[floor, :2]).query(middle[rest, :2], k=_AROUND)[1]
            ground_m = np.median(middle[floor, 2][around], axis=1)
            floor[rest] = np.max([one[rest, 2] for one in (a, b, c)], axis=0) < ground_m + _STEP_M
        return floor


def read_surface(plan: SurfacePlan) -> Mesh:
    """Return the mesh of a file, or that of the cloud in it, in the file's axes and units.

    Raises:
        InputError: the file cannot be read or holds neither.
        ConfigError: its suffix is not known.
    """
    path = Path(plan.file)
    suffix = path.suffix.lower()
    if not path.is_file():
        raise InputError(f"{path}: no such file; the surface of the mine was wanted (surface.file)")
    if suffix == ".dae":
        return read_dae(path)
    if suffix in (".ply", ".obj", ".stl") and plan.kind != "cloud":
        mesh = _read_mesh(path)
        if len(mesh.triangles):
            return mesh
        if plan.kind == "mesh" or suffix != ".ply":
            raise InputError(f"{path}: no triangles were found in it; a mesh was wanted")
    if suffix not in READERS:
        raise ConfigError(f"surface.file = {path}: PLY, OBJ, DAE, STL or a cloud ({', '.join(READERS)}) was wanted")
    return meshed(read_cloud(path).points_m.astype(float), plan.cell_m / plan.scale)


def _read_mesh(path: Path) -> Mesh:
    o3d = library("open3d")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        found = o3d.io.read_triangle_mesh(path)
    return Mesh(np.asarray(found.vertices, dtype=float), np.asarray(found.triangles).astype(np.uint32))


def meshed(points_m: FloatArray, cell_m: float) -> Mesh:
    """Return a mesh through the points (N, 3) of a survey: Poisson's, without what no point is near."""
    io: Any = library("open3d")
    cloud = io.geometry.PointCloud(io.utility.Vector3dVector(points_m[:: max(len(points_m) // _SAMPLES_MAX, 1)]))
    cloud = cloud.voxel_down_sample(cell_m)
    cloud, _ = cloud.remove_statistical_outlier(16, 2.5)
    if len(cloud.points) < 100:
        raise InputError(f"{len(points_m)} points are too few for a surface; a survey of a drift was wanted")
    cloud.estimate_normals(io.geometry.KDTreeSearchParamHybrid(radius=5.0 * cell_m, max_nn=40))
    cloud.orient_normals_consistent_tangent_plane(12)
    extent = float(np.max(cloud.get_max_bound() - cloud.get_min_bound()))
    depth = int(np.clip(np.ceil(np.log2(1.1 * extent / cell_m)), 6, 12))
    mesh, _ = io.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    near = KDTree(np.asarray(cloud.points)).query(vertices, distance_upper_bound=3.0 * cell_m)[0]
    kept = np.isfinite(near)[triangles].all(axis=1)
    return without_unused(Mesh(vertices, triangles[kept].astype(np.uint32)))


def placed(mesh: Mesh, plan: SurfacePlan) -> Mesh:
    """Return a mesh in metres, z up, where the plan has it."""
    points = mesh.vertices_m * plan.scale
    if plan.up == "y":
        points = np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)
    return Mesh(points + np.array(plan.offset_m), mesh.triangles)


def _stations(network: Network, tube: int) -> FloatArray:
    line = network.tubes[tube].line
    return line.at(np.append(np.arange(0.0, line.length_m, _STATION_M), line.length_m))[:, :3]


def _split(mesh: Mesh, floor: npt.NDArray[np.bool_]) -> list[Skin]:
    """Return the mesh in pieces, by the cell that a triangle's middle is in."""
    middle = mesh.vertices_m[mesh.triangles].mean(axis=1)
    cells = np.floor(middle / _CELL_M).astype(np.int64)
    _, owner = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(owner.ravel(), kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(owner.ravel()[order])) + 1)
    return [
        Skin(without_unused(Mesh(mesh.vertices_m, mesh.triangles[part])), floor[part]) for part in parts if len(part)
    ]
