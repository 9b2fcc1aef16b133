"""Surveyed surfaces: meshes of several formats and clouds give the drift that they were made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.machine import Machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.mesh_file import write_ply
from lhdmap.simulation.mine_world.bumper import Bumper
from lhdmap.simulation.mine_world.collada import read_dae
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.vehicle.vehicle import Vehicle

from tests.simulation.mine_world.boxes import HALF_M, tunnel

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


def world_of(folder: Path, file: str, more: str = "") -> MineWorld:
    plan = folder / "plan.toml"
    plan.write_text(
        f'[surface]\nfile = "{file}"\n{more}\n[[drift]]\nname = "A"\nline_m = [[1, 0, 0], [39, 0, 0]]\n',
        encoding="utf-8",
    )
    return MineWorld(make_network(load_plan(plan)), Machine())


def check(world: MineWorld, within_m: float, step_m: float = 0.0) -> None:
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
        assert np.abs(middles[floor, 2]).max(initial=0.0) < max(within_m, step_m)
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
    write_cloud(
        tmp_path / "drift.ply", GridCloud((points + 0.01 * rng.standard_normal(points.shape)).astype(np.float32))
    )
    check(
        world_of(tmp_path, "drift.ply"), 0.08, step_m=0.25
    )  # the rounded foot of the walls is a step that wheels climb


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


def stone(x_m: float, y_m: float, size_m: float, height_m: float) -> Mesh:
    """Return a box on the floor."""
    h = size_m / 2.0
    low = np.array([[x_m - h, y_m - h], [x_m + h, y_m - h], [x_m + h, y_m + h], [x_m - h, y_m + h]])
    vertices = np.concatenate([np.column_stack([low, np.full(4, z)]) for z in (0.0, height_m)])
    sides = [[k, (k + 1) % 4, k + 4] for k in range(4)] + [[(k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    return Mesh(vertices, np.array([*sides, [4, 5, 6], [4, 6, 7]], dtype=np.uint32))


@pytest.mark.parametrize(("height_m", "touches"), [(0.15, False), (0.6, True)])
def test_a_stone_is_floor_and_a_block_is_not(tmp_path: Path, height_m: float, touches: bool) -> None:
    write_ply(tmp_path / "drift.ply", [tunnel(), stone(20.0, 0.0, 0.5, height_m)])
    world = world_of(tmp_path, "drift.ply")
    machine = Machine()
    bumper, vehicle = Bumper(machine, world), Vehicle(machine, world)
    state = vehicle.at_rest(19.0, 0.0, 0.0, near_z_m=0.0, time_ns=0, load_kg=0.0)
    assert bool(bumper.touching(state._replace(z_m=0.05, pitch_rad=0.0, roll_rad=0.0))) == touches


@pytest.mark.parametrize("name", ["jinchuan", "edgar"])
def test_the_lines_of_surveyed_plans_are_between_their_walls(name: str) -> None:
    network = make_network(load_plan(find_plan(name)))
    world = MineWorld(network, Machine())
    line = network.tubes[0].line
    poses = line.at(np.arange(4.0, line.length_m - 4.0, 2.0))
    assert np.abs(world.floor_height(poses[:, :3]) - poses[:, 2]).max() < 0.2
    sides = []
    for side in (1.0, -1.0):
        scene = world.near(poses[0, :3])
        rays = np.zeros((len(poses), 6), dtype=np.float32)
        rays[:, :3] = poses[:, :3] + [0.0, 0.0, 1.2] - scene.origin_m
        rays[:, 3], rays[:, 4] = -side * np.sin(poses[:, 3]), side * np.cos(poses[:, 3])
        sides.append(scene.cast(rays).astype(float))
    assert min(one.min() for one in sides) > 1.6
    beside = np.abs(sides[0] - sides[1])[np.maximum(*sides) < 3.0]
    assert len(beside) > 10
    assert np.median(beside) < 0.35
