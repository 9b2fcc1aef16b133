"""Rocks on a grizzly, the two steps to one of them, and what must not be touched: against simulated and built truth."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import ConfigError, InputError, LhdmapError
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.rockbreaker.collision import Obstacles, axis_points, without_arm
from lhdmap.rockbreaker.cylinders import rho_of_theta
from lhdmap.rockbreaker.environment import cloud_in_base, read_boxes
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.plan import Planner, Request, Trajectory, start_joints
from lhdmap.rockbreaker.rocks import find_rocks
from lhdmap.rockbreaker.settings import RockbreakerSettings
from lhdmap.rockbreaker.task import plan_to_rock
from lhdmap.simulation.grizzly import GrizzlyScene, PlacedRock, simulate_grizzly

from tests.rockbreaker.poses import FR, NL

MACHINE = Rockbreaker()
OPENING_M = MACHINE.grizzly.opening_m
CLEAR_M = 0.05  # of an opening's side: a rock that is nearer to it may be told either way


def _oversize(scene: GrizzlyScene, margin_m: float = 0.0) -> list[PlacedRock]:
    return [rock for rock in scene.rocks if np.sort(rock.extents_m)[1] > OPENING_M + margin_m]


@pytest.mark.parametrize("seed", range(40, 48))
def test_rocks_are_found_with_place_and_size(seed: int) -> None:
    scene = simulate_grizzly(MACHINE, seed)
    found = find_rocks(scene.points_m, MACHINE.grizzly)
    assert found.height_m(4.0, 0.0) == pytest.approx(scene.bars_m, abs=0.02)
    oversize = found.oversize(OPENING_M)
    for rock in _oversize(scene, CLEAR_M):
        near = min(oversize, key=lambda one: float(np.hypot(*(one.top_m - rock.top_m)[:2])))
        assert np.hypot(*(near.top_m - rock.top_m)[:2]) < 0.25
        assert near.top_m[2] == pytest.approx(rock.top_m[2], abs=0.08)
        assert near.size_m == pytest.approx(rock.size_m, rel=0.25)
    places = np.array([rock.top_m[:2] for rock in _oversize(scene, -CLEAR_M)]).reshape(-1, 2)
    for one in oversize:
        assert np.hypot(*(places - one.top_m[:2]).T).min() < 0.3


def test_a_cloud_in_a_national_grid_is_placed_to_the_millimetre(tmp_path: Path) -> None:
    """The machine's place in the grid is known: float32 would leave half a metre of the northing."""
    place = (412_345.0, 6_743_210.0, 312.0)
    machine = replace(MACHINE, base=replace(MACHINE.base, position_m=place))
    points = simulate_grizzly(MACHINE, 3).points_m
    write_cloud(tmp_path / "utm.laz", GridCloud(points.astype(np.float32), origin_m=place))
    write_cloud(tmp_path / "local.laz", GridCloud(points.astype(np.float32)))
    found, local = cloud_in_base(tmp_path / "utm.laz", machine), cloud_in_base(tmp_path / "local.laz", MACHINE)
    assert len(found) == len(local)
    assert np.abs(found - local).max() < 0.0005


def test_the_largest_rock_is_chosen_and_the_tip_ends_above_it() -> None:
    scene = simulate_grizzly(MACHINE, 3)
    seen = find_rocks(scene.points_m, MACHINE.grizzly)
    planner = Planner(MACHINE, RockbreakerSettings(), Obstacles(points_m=scene.points_m))
    task = plan_to_rock(planner, seen, Request(np.array(MACHINE.base.park_m), np.zeros(3)), OPENING_M)
    assert task is not None
    assert task.feasible
    largest = max(_oversize(scene), key=lambda rock: rock.size_m)
    assert np.hypot(*(task.rock.top_m - largest.top_m)[:2]) < 0.2
    highest = max(float(rock.top_m[2]) for rock in scene.rocks)
    assert task.work_plane_m == pytest.approx(highest + RockbreakerSettings().clearance_m, abs=0.08)
    vertical, level = (step.trajectory for step in task.steps)
    assert vertical is not None
    assert level is not None
    up, across = vertical.way_m(), level.way_m()
    assert np.ptp(up[:, :2], axis=0) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert np.ptp(across[:, 2]) == pytest.approx(0.0, abs=1e-9)
    assert across[-1] == pytest.approx(np.array([*task.rock.top_m[:2], task.work_plane_m]), abs=1e-9)
    assert np.linalg.norm(up[-1] - across[0]) < 1e-9
    assert task.bound_s == pytest.approx(_net_stroke_s(vertical, level), abs=1e-9)
    assert task.bound_s < vertical.bound_s + level.bound_s


def _net_stroke_s(first: Trajectory, last: Trajectory) -> float:
    """Return the bound from Table 1 as printed: net strokes times fed areas over the flow limits, valves and pump."""
    begin, end = first.path.theta(np.array([0.0]))[0], last.path.theta(np.array([1.0]))[0]
    stroke = rho_of_theta(MACHINE, end) - rho_of_theta(MACHINE, begin)
    blind, rod = np.array([1.03, 1.03, 2.01, 2.01, 2.01]) * 1e-2, np.array([0.716, 0.716, 1.33, 1.33, 1.33]) * 1e-2
    volumes = np.where(stroke > 0.0, blind, rod) * np.abs(stroke)
    valves = [volumes[0] + volumes[1], *volumes[2:], volumes.sum()]
    return float(max(60_000.0 * v / limit for v, limit in zip(valves, (24.0, 60.0, 60.0, 38.0, 170.0), strict=True)))


def test_a_grizzly_without_large_rocks_asks_for_nothing() -> None:
    scene = simulate_grizzly(MACHINE, 5, rocks=0)
    seen = find_rocks(scene.points_m, MACHINE.grizzly)
    assert seen.oversize(OPENING_M) == ()
    assert plan_to_rock(Planner(), seen, Request(NL[:3], NL[:3]), OPENING_M) is None


def test_a_cloud_from_elsewhere_is_refused() -> None:
    points = np.random.default_rng(0).uniform(50.0, 60.0, (1000, 3))
    with pytest.raises(InputError, match="position_m"):
        find_rocks(points, MACHINE.grizzly)


def test_a_cloud_without_bars_is_refused() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([2.0, -2.0, -4.0], [6.0, 2.0, 2.0], (20_000, 3))
    with pytest.raises(InputError, match="no bars"):
        find_rocks(points, MACHINE.grizzly)


def _way_of(path: str, obstacles: Obstacles) -> tuple[bool, str, float]:
    plan = Planner(MACHINE, RockbreakerSettings(), obstacles).plan(Request(NL[:3], FR[:3], path=path))  # type: ignore[arg-type]
    refusal = plan.refusal
    clearance = plan.trajectory.clearance_m if plan.trajectory else math.nan
    return plan.trajectory is not None, refusal.limit if refusal else "", clearance


def _post(at_m: tuple[float, float]) -> np.ndarray:
    """Return a post as a box (1, 2, 3)."""
    return np.array([[[at_m[0] - 0.1, at_m[1] - 0.1, -2.0], [at_m[0] + 0.1, at_m[1] + 0.1, 3.0]]])


def test_a_post_on_the_straight_line_stops_that_path_and_not_the_other() -> None:
    """Half-way of the straight line the tip is at (4.2, 0); a post where no link comes does not matter."""
    boxes = Obstacles(_post((6.9, 1.2)), ("post",))
    feasible, _, clearance_m = _way_of("cslm", boxes)
    assert feasible
    assert clearance_m > 0.3
    feasible, told, _ = _way_of("cslm", Obstacles(_post((4.2, 0.0)), ("post",)))
    assert not feasible
    assert "post" in told


def test_points_and_boxes_of_the_same_thing_say_the_same() -> None:
    box = _post((4.2, 0.0))[0]
    axes = [np.linspace(low, high, 60 if k == 2 else 9) for k, (low, high) in enumerate(zip(*box, strict=True))]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)
    by_box, by_points = _way_of("cslm", Obstacles(box[None], ("post",))), _way_of("cslm", Obstacles(points_m=points))
    assert by_box[0] == by_points[0] is False


def test_clearance_is_the_distance_of_the_links_less_their_radius() -> None:
    """A wall beside the swing at rest: no motion, so the least distance is known from the geometry of one pose."""
    wall = np.array([[[0.0, 3.0, -3.0], [9.0, 3.2, 6.0]]])
    start = np.array([4.0, 0.0, 0.0])
    planner = Planner(MACHINE, RockbreakerSettings(), Obstacles(wall, ("wall",)))
    plan = planner.plan(Request(start, start + np.array([0.0, 1e-6, 0.0])))
    assert plan.trajectory is not None
    assert plan.trajectory.clearance_m == pytest.approx(min(1.0, 3.0 - 0.30), abs=0.35)
    near = np.array([[[0.0, 0.9, -3.0], [9.0, 1.1, 6.0]]])
    plan = Planner(MACHINE, RockbreakerSettings(), Obstacles(near, ("wall",))).plan(
        Request(start, start + np.array([0.0, 1e-6, 0.0]))
    )
    assert plan.trajectory is not None
    assert plan.trajectory.clearance_m == pytest.approx(0.9 - 0.30, abs=0.01)


def test_a_link_thicker_than_what_is_looked_at_is_not_said_to_touch() -> None:
    joints = tuple(replace(one, radius_m=1.2) for one in MACHINE.joints)
    wall = np.array([[[0.0, 30.0, -3.0], [9.0, 30.2, 6.0]]])
    points = np.array([[3.0, 20.0, 0.0], [3.0, 21.0, 0.0]])
    planner = Planner(Rockbreaker(joints=joints), RockbreakerSettings(), Obstacles(wall, ("wall",), points))
    plan = planner.plan(Request(np.array([4.0, 0.0, 0.0]), np.array([4.0, 1.0, 0.0])))
    assert plan.refusal is None


def test_without_a_step_down_the_plan_starts_where_the_tip_is() -> None:
    scene = simulate_grizzly(MACHINE, 3)
    seen = find_rocks(scene.points_m, MACHINE.grizzly)
    work_plane_m = max(rock.top_m[2] for rock in seen.rocks) + RockbreakerSettings().clearance_m
    start = np.array([3.0, 0.0, work_plane_m + 0.008])
    task = plan_to_rock(Planner(MACHINE), seen, Request(start, start), OPENING_M)
    assert task is not None
    assert len(task.steps) == 1
    assert task.steps[0].request.start_m == pytest.approx(start, abs=1e-12)


def test_the_arm_itself_and_a_leaning_wall_in_the_cloud_are_no_rocks_and_no_obstacles() -> None:
    scene = simulate_grizzly(MACHINE, 3)
    start = np.array([3.0, 0.0, 0.5])
    theta = start_joints(MACHINE, Request(start, start))
    rng = np.random.default_rng(0)
    axis_m, _ = axis_points(MACHINE, theta[None])
    skin = rng.normal(size=(200, len(axis_m[0]), 3))
    arm = (axis_m[0] + 0.2 * skin / np.linalg.norm(skin, axis=-1, keepdims=True)).reshape(-1, 3)
    wall = rng.uniform([2.0, 2.35, scene.bars_m], [6.5, 2.45, scene.bars_m + 5.0], (40_000, 3))
    seen = find_rocks(without_arm(MACHINE, np.concatenate([scene.points_m, arm, wall]), theta), MACHINE.grizzly)
    wanted = find_rocks(scene.points_m, MACHINE.grizzly)
    assert seen.oversize(OPENING_M)[0].top_m == pytest.approx(wanted.oversize(OPENING_M)[0].top_m, abs=0.05)
    assert len(seen.oversize(OPENING_M)) == len(wanted.oversize(OPENING_M))
    kept = without_arm(MACHINE, np.concatenate([scene.points_m, arm]), theta)
    assert len(kept) == len(scene.points_m)
    planner = Planner(MACHINE, RockbreakerSettings(), Obstacles(points_m=kept))
    assert planner.plan(Request(start, start + np.array([0.5, 0.5, 0.0]))).trajectory is not None


def test_capsules_end_at_the_joints_and_at_the_tip() -> None:
    trajectory = Planner().plan(Request(NL[:3], FR[:3])).trajectory
    assert trajectory is not None
    sigma = np.array([0.0, 1.0])
    axis_m, link = axis_points(MACHINE, trajectory.path.theta(sigma))
    assert set(link.tolist()) == {1, 2, 3}
    assert axis_m[:, 0, 2] == pytest.approx([1.10, 1.10])
    tip_distance = np.linalg.norm(axis_m[:, -1] - trajectory.path.tip(sigma), axis=1)
    assert tip_distance == pytest.approx([0.25, 0.25], abs=1e-9)


def test_boxes_are_read_and_wrong_ones_refused(tmp_path: Path) -> None:
    path = tmp_path / "boxes.toml"
    path.write_text("[box.wall]\nmin_m = [0.0, 3.0, -2.0]\nmax_m = [8.0, 3.5, 4.0]\n", encoding="utf-8")
    found = read_boxes(path)
    assert found.names == ("wall",)
    assert found.boxes_m is not None
    assert found.boxes_m[0, 1].tolist() == [8.0, 3.5, 4.0]
    path.write_text("[box.wall]\nmin_m = [0.0, 3.0, -2.0]\nmax_m = [8.0, 3.0, 4.0]\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"box\.wall"):
        read_boxes(path)
    path.write_text("[boxes.wall]\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="did you mean 'box'"):
        read_boxes(path)
    with pytest.raises(InputError, match=r"none\.toml"):
        read_boxes(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "no box"),
        ("box = 3", r"a section \[box\]"),
        ("[box]\nwall = 3", r"a section \[box\.wall\]"),
        ("[box.wall]\nmin_m = [0.0, 1.0]", r"boxes\.toml: box\.wall"),
    ],
)
def test_a_file_without_proper_boxes_is_refused_by_its_name(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "boxes.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(LhdmapError, match=told):
        read_boxes(path)


def test_the_order_of_the_points_does_not_matter() -> None:
    scene = simulate_grizzly(MACHINE, 44)
    shuffled = np.random.default_rng(0).permutation(scene.points_m)
    one, other = (find_rocks(points, MACHINE.grizzly).oversize(OPENING_M) for points in (scene.points_m, shuffled))
    assert len(one) == len(other) > 0
    for a, b in zip(one, other, strict=True):
        assert np.linalg.norm(a.top_m - b.top_m) < 0.05
        assert a.size_m == pytest.approx(b.size_m, abs=0.06)
