"""Mine worlds: one hollow without inner walls or gaps, one floor without steps, levels apart, things where the plan puts them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.simulation.history import Column, History
from lhdmap.simulation.mine_world.hollow import Volume
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.scanner import rig_of
from lhdmap.simulation.sensing.scans import Scanner
from lhdmap.simulation.sensing.sections import ScannerSettings
from scipy.spatial import KDTree

from tests.mine.plans import TEE, lines, network_of

MACHINE = Machine()
FINE = {"mesh_m": 0.12}


def world_of(table: dict[str, Any], **more: Any) -> MineWorld:
    return MineWorld(network_of(table, walls=FINE, **more), MACHINE)


@pytest.fixture(scope="module")
def tee() -> MineWorld:
    return world_of(TEE)


def look(world: MineWorld, point: tuple[float, float], directions: FloatArray, over_floor_m: float = 1.4) -> FloatArray:
    """Return ranges (N,) of level rays in directions (rad) from over the floor."""
    start = np.array([*point, 0.0])
    start[2] = float(world.floor_height(start[None])[0]) + over_floor_m
    scene = world.near(start)
    rays = np.zeros((len(directions), 6), dtype=np.float32)
    rays[:, :3] = start - scene.origin_m
    rays[:, 3], rays[:, 4] = np.cos(directions), np.sin(directions)
    return scene.cast(rays).astype(float)


def test_nothing_is_left_between_drifts_that_join(tee: MineWorld) -> None:
    ahead = look(tee, (40.0, 0.0), np.array([0.0, math.pi, math.pi / 2]))
    assert ahead == pytest.approx([40.0, 40.0, 50.0], abs=1.0)
    across = look(tee, (36.0, 0.0), np.array([math.atan2(10.0, 4.0)]))
    assert across[0] > math.hypot(10.0, 4.0)


def test_the_wall_opposite_stays(tee: MineWorld) -> None:
    ranges = look(tee, (40.0, 0.0), -math.pi / 2 + np.linspace(-0.5, 0.5, 50))
    assert ranges * np.cos(np.linspace(-0.5, 0.5, 50)) == pytest.approx(2.25, abs=0.5)


def test_the_corner_is_cut_by_its_radius(tee: MineWorld) -> None:
    # The wall of a corner of radius r is r (√2 - 1) nearer to where the walls would have met.
    range_m = look(tee, (40.0, 0.0), np.array([math.pi / 4]))[0]
    assert range_m == pytest.approx(math.sqrt(2) * 2.25 + 6.0 * (math.sqrt(2) - 1.0), abs=0.6)


def test_no_ray_escapes(tee: MineWorld) -> None:
    angles = np.linspace(0.0, 2 * math.pi, 720, endpoint=False)
    escaped = sum(
        int((~np.isfinite(look(tee, point, angles))).sum())
        for point in [(x, 0.0) for x in np.arange(2.0, 79.0, 3.0)] + [(40.0, y) for y in np.arange(3.0, 49.0, 3.0)]
    )
    assert escaped <= 2  # of 30,000: a ray may pass along a seam


def test_no_wall_is_left_inside_another_drift(tee: MineWorld) -> None:
    pieces = tee._pieces
    assert pieces is not None
    for tube in range(len(tee.network.tubes)):
        drift = pieces.drift(tube)
        volume = Volume(drift, 0, drift.ring_count(), tee.floor)
        for index, piece in enumerate(pieces.all):
            if piece.tube == tube:
                continue
            skin = tee.piece(index)
            middles = skin.mesh.vertices_m[skin.mesh.triangles[~skin.floor]].mean(axis=1)
            assert volume.holds(middles).mean() < 0.03  # seams


@pytest.mark.parametrize("name", ["ring", "level"])
def test_the_middle_of_all_drifts_and_turns_is_free(name: str) -> None:
    world = MineWorld(make_network(load_plan(find_plan(name))), MACHINE)
    skins = [world.piece(k) for k in range(len(world._boxes))]
    walls = KDTree(
        np.concatenate([skin.mesh.vertices_m[np.unique(skin.mesh.triangles[~skin.floor])] for skin in skins])
    )
    for tube in world.network.tubes:
        ends_m = 0.0 if tube.kind == "turn" else 2.5
        for s in np.arange(ends_m, tube.length_m - ends_m, 1.0):
            eye = tube.pose(s)[:3]
            eye[2] = world.floor_height(eye[None])[0] + 1.3
            assert walls.query(eye)[0] > min(tube.half_width_m(s) - 0.6, 1.2), f"{tube.name} at {s:.1f} m"


def test_floors_join_without_a_step() -> None:
    graded = lines(("A", [[0, 0, 0], [80, 0, 6]]), ("B", [[40, 0, 3.0], [40, 50, -2]]))
    world = world_of(graded, floor={"undulation_m": 0.0, "roughness_m": 0.0})
    x, y = np.meshgrid(np.arange(34.0, 46.0, 0.05), np.arange(-2.0, 10.0, 0.05))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 3.0)], axis=1)
    height = world.floor_height(points).reshape(x.shape)
    height[~_within(world, x, y)] = np.nan
    assert np.nanmax(np.abs(np.diff(height, axis=0))) < 0.05 * 0.35
    assert np.nanmax(np.abs(np.diff(height, axis=1))) < 0.05 * 0.35
    assert world.floor_height(np.array([[10.0, 0.0, 0.5], [40.0, 30.0, 0.0]])) == pytest.approx([0.75, 0.0], abs=0.02)


def _within(world: MineWorld, x: FloatArray, y: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which places are between the walls of a drift or a turn."""
    found = np.zeros(x.shape, dtype=bool)
    for tube in world.network.tubes:
        line = np.stack([tube.line.x_m, tube.line.y_m], axis=1)[::10]
        found |= KDTree(line).query(np.stack([x, y], axis=-1))[0] < 0.95 * tube.half_width_m(0.5 * tube.length_m)
    return found


def test_wheels_stand_where_rays_meet_the_floor(tee: MineWorld) -> None:
    rng = np.random.default_rng(0)
    points = np.stack([rng.uniform(3.0, 77.0, 500), rng.uniform(-1.5, 1.5, 500), np.full(500, 0.0)], axis=1)
    scene = tee.near(points[0])
    rays = np.zeros((500, 6), dtype=np.float32)
    rays[:, :3] = points + np.array([0.0, 0.0, 1.0]) - scene.origin_m
    rays[:, 5] = -1.0
    seen = points[:, 2] + 1.0 - scene.cast(rays)
    assert np.abs(seen - tee.floor_height(points)).max() < 0.02
    assert np.sqrt(np.mean((seen - tee.floor_height(points)) ** 2)) < 0.004


@pytest.mark.parametrize(("undulation_m", "roughness_m"), [(0.035, 0.0), (0.0, 0.02), (0.06, 0.012)])
def test_the_floor_is_as_uneven_as_the_plan_says(undulation_m: float, roughness_m: float) -> None:
    world = world_of(TEE, floor={"undulation_m": undulation_m, "roughness_m": roughness_m})
    x, y = np.meshgrid(np.arange(0.0, 80.0, 0.07), np.arange(-2.0, 2.0, 0.07))
    height = world.floor_height(np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1))
    assert height.std() == pytest.approx(math.hypot(undulation_m, roughness_m), rel=0.25)


def test_levels_above_each_other_do_not_mix() -> None:
    world = world_of(lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, -40, 7], [40, 40, 7]])))
    points = np.array([[40.0, 0.0, 0.5], [40.0, 0.0, 7.5]])
    assert world.floor_height(points) == pytest.approx([0.0, 7.0], abs=0.2)
    roof = world.near(points[0])
    rays = np.zeros((2, 6), dtype=np.float32)
    rays[:, :3], rays[:, 5] = points + np.array([0.0, 0.0, 1.0]) - roof.origin_m, 1.0
    assert roof.cast(rays) == pytest.approx(4.0 - 1.5, abs=0.5)


def test_walls_have_the_roughness_and_width_of_the_plan() -> None:
    world = world_of(lines(("A", [[0, 0, 0], [120, 0, 0]])), floor={"undulation_m": 0.0})
    ranges = np.concatenate(
        [look(world, (x, 0.0), np.array([math.pi / 2, -math.pi / 2])) for x in np.arange(5, 115, 0.5)]
    )
    assert ranges.mean() == pytest.approx(2.25, abs=0.08)
    assert ranges.std() == pytest.approx(0.12, abs=0.04)


def test_same_plan_same_world() -> None:
    a, b = (world_of(TEE, seed=4) for _ in range(2))
    assert all(np.array_equal(a.piece(k).mesh.vertices_m, b.piece(k).mesh.vertices_m) for k in range(4))
    other = world_of(TEE, seed=5)
    assert not np.array_equal(a.piece(0).mesh.vertices_m, other.piece(0).mesh.vertices_m)


def test_a_pile_stands_in_its_draw_point_and_steps_back_when_loaded() -> None:
    world = world_of(TEE, place=[{"drift": "B", "kind": "draw_point", "side": "end", "name": "DP"}])
    before = look(world, (40.0, 30.0), np.array([math.pi / 2]), 0.5)[0]
    assert before == pytest.approx(50.0 - 8.0 - 30.0, abs=1.5)
    world.load("DP", 1.5)
    assert look(world, (40.0, 30.0), np.array([math.pi / 2]), 0.5)[0] - before == pytest.approx(1.5, abs=0.7)


def test_a_dump_has_no_floor_behind_its_stop_log() -> None:
    world = world_of(TEE, place=[{"drift": "B", "kind": "dump", "side": "end", "name": "OP"}])
    scene = world.near(np.array([40.0, 40.0, 1.0]))
    rays = np.zeros((3, 6), dtype=np.float32)
    rays[:, :3] = np.array([[40.0, 44.0, 1.5], [40.0, 46.82, 1.5], [40.0, 49.0, 1.5]]) - scene.origin_m
    rays[:, 5] = -1.0
    floor, log, pit = scene.cast(rays)
    assert floor == pytest.approx(1.5, abs=0.15)
    assert log == pytest.approx(1.5 - 0.45, abs=0.15)
    assert pit > 1.3  # the bars of the grizzly, or the bottom


def test_people_come_and_go(tee: MineWorld) -> None:
    from lhdmap.simulation.mine_world.things import placed, shape_of

    before = look(tee, (20.0, 0.0), np.zeros(1))[0]
    tee.appear("person", placed(shape_of("person", (0, 0, 0), MACHINE), np.array([25.0, 0.0, 0.0, 0.0])))
    assert look(tee, (20.0, 0.0), np.zeros(1))[0] == pytest.approx(4.75, abs=0.02)
    tee.vanish("person")
    assert look(tee, (20.0, 0.0), np.zeros(1))[0] == before


def test_water_is_slippery_and_dust_hangs_where_the_plan_says() -> None:
    wet = {"drift": "A", "from_m": 10.0, "to_m": 20.0}
    world = world_of(TEE, wet=[wet], dust=[{**wet, "share": 0.2}])
    places = [np.array([x, 0.5, 0.2]) for x in (5.0, 15.0, 25.0)]
    assert [world.friction(place) for place in places] == [0.6, 0.34, 0.6]
    assert [world.dust(place) for place in places] == [0.0, 0.2, 0.0]


def test_what_bodies_may_touch_is_near_them(tee: MineWorld) -> None:
    box = np.array([[18.0, -3.0, 0.0], [26.0, 3.0, 3.0]])
    keys = tee.keys_in(box)
    assert 0 < len(keys) < 4
    for key in keys:
        mesh, floor = tee.solid(key)
        assert floor is not None
        mesh = mesh._replace(triangles=mesh.triangles[~floor])
        a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        level = np.abs(normal[:, 2]) > 0.95 * np.linalg.norm(normal, axis=1)
        assert (mesh.vertices_m[mesh.triangles].mean(axis=1)[level, 2] > 1.5).all()  # roof, no floor


def test_a_mine_of_five_kilometres_is_there_at_once() -> None:
    long = [[0, 40 * k, 0] if k % 2 == 0 else [250, 40 * k, 0] for k in range(20)]
    points = [point for k in range(20) for point in ((long[k], [250 - long[k][0], 40 * k, 0]))]
    network: Network = network_of(lines(("A", points)))
    world = MineWorld(network, MACHINE)
    assert sum(edge.length_m for edge in network.edges) > 5000.0
    assert look(world, (100.0, 0.0), np.array([math.pi / 2]))[0] == pytest.approx(2.25, abs=0.6)


def test_dust_that_hangs_in_a_drift_is_what_scanners_see_there() -> None:
    zone = {"drift": "A", "from_m": 10.0, "to_m": 20.0, "share": 0.3}
    world = world_of(TEE, dust=[zone])
    near = [_share_nearer(world, x) for x in (5.0, 15.0)]
    assert near[0] == 0.0
    assert 0.05 < near[1] < 0.3  # dust behind a wall is not seen


def _share_nearer(world: MineWorld, x_m: float) -> float:
    """Return the share of beams of some scans that are much shorter than without dust."""
    scans = []
    for where in (world, MineWorld(network_of(TEE, walls=FINE), MACHINE)):
        history = History(100.0)
        row = np.zeros(len(Column))
        row[:3] = x_m, 0.0, float(world.floor_height(np.array([[x_m, 0.0, 0.0]]))[0])
        for _ in range(30):
            history.append(row)
        sensor = Scanner(
            "front", ScannerSettings(noise_m=0.0), rig_of(MACHINE, MACHINE.mounts["lidar_front"], occlusion=False), 1
        )
        records = [record for _ in range(6) for record in sensor.read(history, where)]
        scans.append(np.array([record.message.ranges_m for record in records if isinstance(record.message, LaserScan)]))
    return float((scans[0] < scans[1] - 0.05).mean())
