"""Surveyed surfaces: meshes of several formats and clouds give the drift that they were made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.integration.cloud import Cloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.machine import Machine
from lhdmap.mine.network import make_network
from lhdmap.mine.plan import load_plan
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.mesh_file import write_ply
from lhdmap.simulation.mine_world.collada import read_dae
from lhdmap.simulation.mine_world.world import MineWorld

HALF_M, HEIGHT_M, LENGTH_M = 2.0, 3.5, 40.0

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit meter="0.01"/><up_axis>Z_UP</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="12">0 0 0 100 0 0 100 100 0 0 100 0</float_array></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  {faces}
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node>
  <translate>300 0 0</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>
  <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
</COLLADA>
"""
INPUTS = '<input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>'
FACES = {
    "triangles": f'<triangles count="2">{INPUTS}<p>0 9 1 9 2 9 0 9 2 9 3 9</p></triangles>',
    "polylist": f'<polylist count="1">{INPUTS}<vcount>4</vcount><p>0 9 1 9 2 9 3 9</p></polylist>',
}


def tunnel() -> Mesh:
    """Return a straight box of a drift along x, floor at z = 0."""
    x = np.arange(0.0, LENGTH_M + 0.1, 0.25)
    ring = np.array([[-HALF_M, 0.0], [-HALF_M, HEIGHT_M], [HALF_M, HEIGHT_M], [HALF_M, 0.0]])
    vertices = np.concatenate([np.column_stack([np.full(4, at), ring]) for at in x])
    sides = [[k, (k + 1) % 4, k + 4] for k in range(4)] + [[(k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    triangles = np.concatenate([np.array(sides) + 4 * n for n in range(len(x) - 1)])
    return Mesh(vertices, triangles.astype(np.uint32))


def world_of(folder: Path, file: str, more: str = "") -> MineWorld:
    plan = folder / "plan.toml"
    plan.write_text(
        f'[surface]\nfile = "{file}"\n{more}\n[[drift]]\nname = "A"\nline_m = [[1, 0, 0], [39, 0, 0]]\n',
        encoding="utf-8",
    )
    return MineWorld(make_network(load_plan(plan)), Machine())


def check(world: MineWorld, within_m: float) -> None:
    points = np.array([[x, y, 0.3] for x in (8.0, 20.0, 32.0) for y in (-1.0, 0.0, 1.0)])
    assert world.floor_height(points) == pytest.approx(0.0, abs=within_m)
    scene = world.near(points[4])
    rays = np.zeros((2, 6), dtype=np.float32)
    rays[:, :3] = np.array([20.0, 0.0, 1.5]) - scene.origin_m
    rays[:, 4] = [1.0, -1.0]
    assert scene.cast(rays) == pytest.approx(HALF_M, abs=within_m)
    keys = world.keys_in(np.array([[15.0, -3.0, -1.0], [25.0, 3.0, 5.0]]))
    assert keys
    for key in keys:
        mesh, floor = world.solid(key)
        middles = mesh.vertices_m[mesh.triangles].mean(axis=1)
        assert floor is not None
        assert np.abs(middles[floor, 2]).max(initial=0.0) < within_m
        assert middles[~floor, 2].min(initial=1.0) > -within_m


def test_a_mesh(tmp_path: Path) -> None:
    write_ply(tmp_path / "drift.ply", [tunnel()])
    check(world_of(tmp_path, "drift.ply"), 1e-4)


def test_a_mesh_with_y_up_and_its_own_unit_and_origin(tmp_path: Path) -> None:
    mesh = tunnel()
    x, y, z = (mesh.vertices_m - [100.0, 0.0, 50.0]).T
    write_ply(tmp_path / "drift.ply", [Mesh(np.stack([x, z, -y], axis=1) * 100.0, mesh.triangles)])
    check(world_of(tmp_path, "drift.ply", 'up = "y"\nscale = 0.01\noffset_m = [100, 0, 50]'), 1e-3)


def test_a_survey_cloud_is_meshed(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    mesh = tunnel()
    a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    pick = rng.choice(len(area), 60_000, p=area / area.sum())
    u, v = np.sort(rng.random((2, 60_000)), axis=0)
    points = u[:, None] * a[pick] + (v - u)[:, None] * b[pick] + (1 - v)[:, None] * c[pick]
    write_cloud(tmp_path / "drift.ply", Cloud((points + 0.01 * rng.standard_normal(points.shape)).astype(np.float32)))
    check(world_of(tmp_path, "drift.ply"), 0.08)


@pytest.mark.parametrize("kind", FACES)
def test_collada_places_its_geometry_in_metres(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "square.dae"
    file.write_text(DAE.format(faces=FACES[kind]), encoding="utf-8")
    mesh = read_dae(file)
    # Scaled along x, turned by 90°, then moved: (100, 0, 0) cm -> (200, 0) -> (0, 200) -> (300, 200) cm.
    assert mesh.vertices_m[1] == pytest.approx([3.0, 2.0, 0.0])
    a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
    assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(2.0)


@pytest.mark.parametrize("text", ["<COLLADA>", "<COLLADA></COLLADA>", DAE.format(faces="<triangles/>")])
def test_damaged_collada_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "square.dae"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"square\.dae"):
        read_dae(file)


def test_a_surface_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.ply: no such file; the surface of the mine was wanted"):
        world_of(tmp_path, "none.ply")
