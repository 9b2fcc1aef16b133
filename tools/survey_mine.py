"""A mine plan of a surveyed mine: `python -m tools.survey_mine ROUGH.toml OUT.toml --triangles 90000`.

The rough plan names a survey (cloud or mesh) as its surface and has drifts whose lines are drawn by hand. Out comes the same plan
with the surface as a mesh beside it (`OUT.ply`: what is near the drifts, z up, metres), lines that are in the middle between
the walls and on the floor, and widths as they are there.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.messages import FloatArray
from lhdmap.mine.plan import DriftPlan, MinePlan, load_plan
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.mine_world.hollow import without_unused
from lhdmap.simulation.mine_world.survey import meshed, placed, read_surface
from lhdmap.simulation.raycast import Surface
from scipy.ndimage import gaussian_filter1d, median_filter
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

CLEAR = (
    "what a cloud has nearer than so to the drawn lines, between floor and roof, is taken out: surveyors, passers-by"
)
_STEP_M = 2.0
_CAMBER_M = 1.0
_AROUND_M = 1.2
_ABOVE_FLOOR_M, _BELOW_ROOF_M = 0.35, 0.6  # what is between is no floor and no roof
_NEAR_M = 12.0  # of the drifts' lines is kept
_HEIGHTS_M = np.arange(0.6, 2.3, 0.2)  # above the floor: what a machine is beside
_OPEN_M = 4.2  # a wall that is farther is an opening
_EYE_M = 1.5
_SMOOTH, _NICHE = 2.0, 7  # stations
_LEAST_TRIANGLES = 3_000  # of a part that is no stray


def main() -> int:
    """Mesh, centre, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rough", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--triangles", type=int, default=0, help="at most; 0: as many as there are")
    parser.add_argument("--clear", type=float, default=0.0, metavar="M", help=CLEAR)
    asked = parser.parse_args()
    make_plan(asked.rough, asked.out, asked.clear, asked.triangles)
    return 0


def make_plan(rough: Path, out: Path, clear_m: float = 0.0, triangles: int = 0) -> None:
    """Write the plan `out` and its mesh beside it."""
    plan = load_plan(rough)
    mesh, turn = made(plan, clear_m, triangles), np.eye(3)
    plan = replace(plan, drifts=_centred(plan, mesh))
    if clear_m:  # the middle of the drifts is known better now than it was drawn, and by how much the survey leans
        turn = upright(plan, mesh)
        plan = replace(plan, drifts=tuple(_turned(one, turn) for one in plan.drifts))
        mesh = made(plan, clear_m, triangles, turn)
        plan = replace(plan, drifts=_centred(plan, mesh))
        print("turned by", np.degrees(Rotation.from_matrix(turn).as_rotvec()).round(2), "degrees")
    write_small_ply(out.with_suffix(".ply"), mesh)
    out.write_text(plan_toml(plan, out.with_suffix(".ply").name), encoding="utf-8")


def made(plan: MinePlan, clear_m: float, triangles: int, turn: FloatArray | None = None) -> Mesh:
    """Return the mesh of a plan's survey near its drifts: at most so many triangles (0: all), turned (3, 3)."""
    mesh = _kept(_surface(plan, clear_m, np.eye(3) if turn is None else turn), plan)
    return _fewer(mesh, triangles) if 0 < triangles < len(mesh.triangles) else mesh


def _centred(plan: MinePlan, mesh: Mesh) -> tuple[DriftPlan, ...]:
    done: list[DriftPlan] = []
    for drift in plan.drifts:
        done.append(centred(drift, Surface(mesh), done))
    return tuple(done)


def plan_toml(plan: MinePlan, file: str) -> str:
    """Return the plan as a file: what differs from the defaults."""
    text = [f'name = "{plan.name}"\nseed = {plan.seed}\n\n[surface]\nfile = "{file}"\nkind = "mesh"\n']
    for kind, parts in (("drift", plan.drifts), ("place", plan.places), ("junction", plan.junctions)):
        text += [f"[[{kind}]]\n{_keys(part)}" for part in parts]
    return "\n".join(text)


def _keys(part: Any) -> str:
    lines = []
    for field in fields(part):
        value = getattr(part, field.name)
        if value != field.default and value is not None:
            told = [list(one) for one in value] if isinstance(value, tuple) and isinstance(value[0], tuple) else value
            lines.append(f"{field.name} = {json.dumps(told)}\n")
    return "".join(lines)


def upright(plan: MinePlan, mesh: Mesh) -> FloatArray:
    """Return the rotation (3, 3) after which the floor of the first drift is level across on the mean; grades stay as they are."""
    line = np.array(plan.drifts[0].line_m)
    surface, left = Surface(mesh), np.column_stack([_left(line), np.zeros(len(line))])
    sides = [_floor(surface, line + side * _CAMBER_M * left) for side in (1.0, -1.0)]
    roll = float(np.median(np.arctan2(sides[0] - sides[1], 2.0 * _CAMBER_M)))
    ahead = line[-1, :2] - line[0, :2]
    axis = np.append(ahead / np.linalg.norm(ahead), 0.0)
    turn: FloatArray = Rotation.from_rotvec(-roll * axis).as_matrix()
    return turn


def _turned(drift: DriftPlan, turn: FloatArray) -> DriftPlan:
    return replace(drift, line_m=tuple(map(tuple, (np.array(drift.line_m) @ turn.T).tolist())))


def _surface(plan: MinePlan, clear_m: float, turn: FloatArray) -> Mesh:
    """Return the mesh of the survey in metres, z up."""
    if not clear_m:
        return placed(read_surface(plan.surface), plan.surface)
    points = read_cloud(Path(plan.surface.file)).points_m.astype(float)
    points = placed(Mesh(points, np.zeros((0, 3), np.uint32)), plan.surface).vertices_m @ turn.T
    return meshed(points[~_stray(points, plan, clear_m)], plan.surface.cell_m)


def _stray(points: FloatArray, plan: MinePlan, clear_m: float) -> npt.NDArray[np.bool_]:
    """Return which points (N, 3) hang in the middle of a drift, between floor and roof."""
    lines = np.concatenate([_stations(np.array(one.line_m), 0.5) for one in plan.drifts])
    away, station = KDTree(lines[:, :2]).query(points[:, :2])
    middle = away < clear_m
    stray = np.zeros(len(points), dtype=bool)
    tree = KDTree(points[middle, :2])
    height = points[middle, 2]
    for index in np.unique(station[middle]):
        around = height[tree.query_ball_point(lines[index, :2], _AROUND_M)]
        if len(around) < 20:
            continue
        floor, roof = np.percentile(around, (4.0, 96.0))
        of = middle & (station == index)
        stray[of] = (points[of, 2] > floor + _ABOVE_FLOOR_M) & (points[of, 2] < roof - _BELOW_ROOF_M)
    return stray


def centred(drift: DriftPlan, surface: Surface, before: list[DriftPlan]) -> DriftPlan:
    """Return a drift in the middle between its walls; ends that touch a drift before it end on that one's line."""
    line = _stations(np.array(drift.line_m))
    for _ in range(3):
        line[:, 2] = _floor(surface, line)
        left, right = _walls(surface, line)
        shift = 0.5 * (left - right)
        shift[[0, -1]] = 0.0
        line[:, :2] += gaussian_filter1d(shift, _SMOOTH)[:, None] * _left(line)
    left, right = _walls(surface, line)
    width = 2.0 * np.minimum(left, right)
    for end in (0, -1):
        _snap(line, end, before)
    line[:, 2] = gaussian_filter1d(_floor(surface, line), _SMOOTH)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    widths = tuple((round(float(s), 1), round(float(w), 2)) for s, w in zip(along, width, strict=True))
    points = tuple((round(x, 2), round(y, 2), round(z, 2)) for x, y, z in line.tolist())
    return replace(drift, line_m=points, width_m=widths)


def _stations(corners: FloatArray, step_m: float = _STEP_M) -> FloatArray:
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners[:, :2], axis=0).T)))
    at = np.linspace(0.0, along[-1], max(2, round(along[-1] / step_m) + 1))
    return np.column_stack([np.interp(at, along, corners[:, k]) for k in range(3)])


def _left(line: FloatArray) -> FloatArray:
    """Return the unit vectors (N, 2) to the left of a line."""
    ahead = np.gradient(gaussian_filter1d(line[:, :2], 1.0, axis=0), axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    return np.column_stack([-ahead[:, 1], ahead[:, 0]])


def _floor(surface: Surface, line: FloatArray) -> FloatArray:
    rays = np.zeros((len(line), 6), dtype=np.float32)
    rays[:, :3] = line - surface.origin_m
    rays[:, 2] += _EYE_M
    rays[:, 5] = -1.0
    down = surface.cast(rays).astype(float)
    return np.interp(np.arange(len(line)), *_found(line[:, 2] + _EYE_M - down, down < 2.0 * _EYE_M))


def _walls(surface: Surface, line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far the walls are to the left and to the right, (N,) each; openings and niches are passed over."""
    found = []
    for side in (1.0, -1.0):
        rays = np.zeros((len(line), len(_HEIGHTS_M), 6), dtype=np.float32)
        rays[:, :, :3] = (line - surface.origin_m)[:, None, :]
        rays[:, :, 2] += _HEIGHTS_M
        rays[:, :, 3:5] = (side * _left(line))[:, None, :]
        away = surface.cast(rays.reshape(-1, 6)).reshape(len(line), -1).min(axis=1).astype(float)
        found.append(median_filter(_through(away, away < _OPEN_M), _NICHE, mode="nearest"))
    return found[0], found[1]


def _through(values: FloatArray, usable: npt.NDArray[np.bool_]) -> FloatArray:
    return np.interp(np.arange(len(values)), *_found(values, usable))


def _found(values: FloatArray, usable: npt.NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    if not usable.any():
        raise SystemExit("there are no walls beside a line")
    return np.flatnonzero(usable).astype(float), values[usable]


def _snap(line: FloatArray, end: int, before: list[DriftPlan]) -> None:
    """Put an end onto the line of a drift that it touches."""
    for other in before:
        dense = _stations(np.array(other.line_m), 0.1)
        apart = np.hypot(*(dense[:, :2] - line[end, :2]).T)
        if apart.min() < _OPEN_M:
            line[end] = dense[apart.argmin()]


def _kept(mesh: Mesh, plan: MinePlan) -> Mesh:
    """Return what is near the drifts, without strays."""
    lines = np.concatenate([_stations(np.array(one.line_m)) for one in plan.drifts])
    near = KDTree(lines[:, :2]).query(mesh.vertices_m[:, :2])[0] < _NEAR_M
    mesh = without_unused(Mesh(mesh.vertices_m, mesh.triangles[near[mesh.triangles].all(axis=1)]))
    io = _open3d()
    parts, counts, _ = _as_open3d(io, mesh).cluster_connected_triangles()
    least = min(_LEAST_TRIANGLES, int(np.max(counts)))
    big = np.asarray(counts)[np.asarray(parts)] >= least
    return without_unused(Mesh(mesh.vertices_m, mesh.triangles[big])) if plan.surface.kind == "cloud" else mesh


def _fewer(mesh: Mesh, triangles: int) -> Mesh:
    found = _as_open3d(_open3d(), mesh).simplify_quadric_decimation(target_number_of_triangles=triangles)
    return Mesh(np.asarray(found.vertices, dtype=float), np.asarray(found.triangles).astype(np.uint32))


def _open3d() -> Any:
    import open3d

    return open3d


def _as_open3d(io: Any, mesh: Mesh) -> Any:
    return io.geometry.TriangleMesh(
        io.utility.Vector3dVector(mesh.vertices_m), io.utility.Vector3iVector(mesh.triangles.astype(np.int32))
    )


def write_small_ply(path: Path, mesh: Mesh) -> None:
    """Write a mesh as binary PLY with float32, millimetres are kept up to 16 km from the origin."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices_m)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(mesh.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.triangles), dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"], faces["index"] = 3, mesh.triangles
    path.write_bytes(header.encode("ascii") + mesh.vertices_m.astype("<f4").tobytes() + faces.tobytes())


if __name__ == "__main__":
    raise SystemExit(main())
