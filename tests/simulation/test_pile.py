"""Drifts that end in a pile: the truth against geometry, chance by the seed, what the scanner sees of each variant."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.errors import ConfigError, UsageError
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.pile_facts import PileTruth, fit_face
from lhdmap.simulation.pile_rocks import cylinder, extent, rock
from lhdmap.simulation.pile_scenes import scene
from lhdmap.simulation.pile_sections import VARIANTS, MountingSettings, SimulatedPileSettings
from lhdmap.simulation.pile_truth import off_walls, pile_truth, plane_over
from lhdmap.simulation.raycast import Surface
from lhdmap.simulation.scenario import DriftScenario, scenario_from, scenario_toml
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.world import DriftWorld

from tests.simulation.scanners import exact, scanner

CLEAN = DriftSettings(
    pieces=((200.0, 0.0, 0.0),),
    profile="box",
    roughness_m=0.0,
    floor_undulation_m=0.0,
    floor_roughness_m=0.0,
    mesh_m=0.1,
)
PLANE = SimulatedPileSettings(toe_m=20.0, back_m=6.0, d50_m=0.0, roughness_m=0.0)
DRIVE = DriveSettings(distance_m=12.0, wander_m=0.0, vibration_deg=0.0)


def clean_world(*, drift: DriftSettings = CLEAN, seed: int = 0, **changes: Any) -> DriftWorld:
    """Return a smooth box drift of 4 m that ends in a smooth plane of 45°, with changes of the pile."""
    pile = replace(PLANE, **changes)
    return DriftWorld(DriftScenario(seed=seed, drift=drift, drive=DRIVE, pile=pile, mounting=MountingSettings()))


def clean_truth(**changes: Any) -> PileTruth:
    return pile_truth(clean_world(**changes))


@pytest.mark.parametrize("seed", [0, 1, 2])  # another heading each
def test_a_clean_pile_has_the_width_and_inclination_it_was_made_with(seed: int) -> None:
    truth = clean_truth(seed=seed)
    assert truth.inclination_deg == pytest.approx(-45.0, abs=0.05)
    assert truth.width_m == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize("heights_m", [(0.2, 1.6), (0.2, 0.8), (0.9, 1.5)])
def test_a_plane_slopes_alike_over_all_heights(heights_m: tuple[float, float]) -> None:
    world = clean_world()
    found = plane_over(world, pile_truth(world), heights_m)
    assert found is not None
    assert found.inclination_deg == pytest.approx(-45.0, abs=0.05)


@pytest.mark.parametrize(("heights_m", "slope_deg"), [((0.2, 0.9), 35.0), ((1.1, 1.6), 60.0)])
def test_a_bent_face_slopes_as_it_was_made_below_and_above_the_bend(
    heights_m: tuple[float, float], slope_deg: float
) -> None:
    world = clean_world(slope_deg=35.0, upper_slope_deg=60.0, bend_m=1.0)
    found = plane_over(world, pile_truth(world), heights_m)
    assert found is not None
    assert found.inclination_deg == pytest.approx(-slope_deg, abs=1.0)


def test_no_face_at_heights_where_there_is_none() -> None:
    world = clean_world()
    assert plane_over(world, pile_truth(world), (-3.0, -2.5)) is None


@pytest.mark.parametrize("slope_deg", [15.0, 35.0, 55.0, 75.0, 90.0, 110.0])
def test_the_sign_is_that_of_table_6(slope_deg: float) -> None:
    back = {"back_m": 12.0} if slope_deg < 20 else {}
    truth = clean_truth(slope_deg=slope_deg, upper_slope_deg=slope_deg, **back)
    assert truth.inclination_deg == pytest.approx(-slope_deg, abs=0.1)
    assert truth.width_m == pytest.approx(4.0, abs=0.02)


def test_the_width_of_a_skewed_face_is_taken_in_its_plane() -> None:
    truth = clean_truth(skew_deg=20.0)
    assert truth.width_m == pytest.approx(4.0 / math.cos(math.radians(20.0)), abs=0.02)
    assert truth.inclination_deg == pytest.approx(-45.0, abs=0.1)  # along the drift
    across = truth.toe_m[-1, :2] - truth.toe_m[0, :2]
    end = np.array([math.cos(truth.end_heading_rad), math.sin(truth.end_heading_rad)])
    assert across @ end == pytest.approx(4.0 * math.tan(math.radians(20.0)), abs=0.1)  # its left side is nearer


def test_in_a_stope_the_width_is_the_aperture() -> None:
    stope = replace(CLEAN, widenings=((18.5, 0.0, 0.0, 0.0), (18.7, 2.0, 1.0, 1.0)))
    truth = clean_truth(drift=stope, mouth_m=1.5)
    assert truth.width_m == pytest.approx(4.0, abs=0.03)
    assert np.ptp(truth.toe_m @ _left(truth)) == pytest.approx(7.0, abs=0.1)
    assert truth.inclination_deg == pytest.approx(-45.0, abs=0.1)


def _left(truth: PileTruth) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([-math.sin(truth.end_heading_rad), math.cos(truth.end_heading_rad), 0.0])


@pytest.mark.parametrize("slope_deg", [30.0, 45.0, 60.0])
def test_the_volume_of_a_wedge(slope_deg: float) -> None:
    volumes = clean_truth(slope_deg=slope_deg, upper_slope_deg=slope_deg).volumes_m3
    for height, volume in volumes.items():
        assert volume == pytest.approx(4.0 * 0.5 * height**2 / math.tan(math.radians(slope_deg)), rel=0.05)


def test_a_boulder_is_not_in_the_inclination_but_in_the_list() -> None:
    truth = clean_truth(boulders=((0.6, 0.8, 1.2, 0.6),))
    assert truth.inclination_deg == pytest.approx(-45.0, abs=0.05)
    (boulder,) = truth.boulders
    assert boulder.size_m == pytest.approx(1.2, abs=1e-6)
    assert 0.5 < boulder.visible_size_m <= boulder.size_m
    offset = boulder.center_m - clean_truth().center_m
    assert offset @ _left(truth) == pytest.approx(0.6, abs=0.05)
    assert offset[2] == pytest.approx(0.8, abs=0.3)


def test_rocks_before_the_toe_are_not_in_the_truth() -> None:
    spilled, bare = clean_truth(spill=20, spill_reach_m=2.0), clean_truth()
    assert spilled.inclination_deg == bare.inclination_deg
    assert spilled.width_m == bare.width_m


def test_the_distance_is_that_to_the_nearest_point_of_the_toe() -> None:
    world = clean_world()
    distances = pile_truth(world).distances_m(world.history.rows[[0, -1], :3])
    assert distances == pytest.approx([20.0, 8.0], abs=0.06)


def test_a_regression_is_not_moved_by_rays_that_hit_something_else() -> None:
    rng = np.random.default_rng(0)
    at = rng.uniform((-2.0, 0.2), (2.0, 1.6), (2000, 2))
    x = 3.0 + 0.1 * at[:, 0] + 0.8 * at[:, 1] + 0.05 * rng.standard_normal(2000)
    x[:300] -= rng.uniform(0.5, 2.0, 300)
    plane = fit_face(x, at)
    assert plane is not None
    assert (plane.by_y, plane.by_z) == pytest.approx((0.1, 0.8), abs=0.01)
    assert fit_face(x[:20], at[:20]) is None


def test_eight_centimetres_at_each_wall_are_left_out() -> None:
    hit = np.zeros((1, 12), dtype=bool)
    hit[0, 2:10] = True
    assert np.flatnonzero(off_walls(hit)[0]).tolist() == [4, 5, 6, 7]


@given(size=st.floats(0.1, 2.0), seed=st.integers(0, 200))
def test_a_rock_is_as_large_as_it_says_and_closed(size: float, seed: int) -> None:
    mesh = rock(size, np.random.default_rng(seed))
    assert extent(mesh.vertices_m) == pytest.approx(size, rel=1e-9)
    rays = np.zeros((3, 6), dtype=np.float32)
    surface = Surface(mesh)
    rays[:, :3], rays[:, 3:] = -surface.origin_m, np.eye(3)
    assert (surface.cast(rays) < size).all()


def test_a_cylinder_stands_where_it_should() -> None:
    mesh = cylinder(np.array([1.0, 2.0, 0.5]), np.array([0.0, 0.0, 1.0]), 0.2)
    assert mesh.vertices_m.min(axis=0) == pytest.approx([0.8, 1.8, 0.0], abs=0.01)
    assert mesh.vertices_m.max(axis=0) == pytest.approx([1.2, 2.2, 1.0], abs=0.01)


@pytest.fixture(scope="module", params=VARIANTS)
def world(request: pytest.FixtureRequest) -> DriftWorld:
    scenario = scene(request.param, 3)
    return DriftWorld(replace(scenario, drift=replace(scenario.drift, mesh_m=0.15)))


@pytest.fixture(scope="module")
def truth(world: DriftWorld) -> PileTruth:
    return pile_truth(world)


def test_the_scanner_sees_what_the_variant_is_about(world: DriftWorld) -> None:
    """The last scans differ from those of the same drift without it; where there is nothing, they look far."""
    pile = world.pile
    assert pile is not None
    front, last_s = scanner(world), world.history.last_s
    times_s = [0.0, 0.5 * last_s, last_s - 2.4, last_s - 1.6, last_s - 0.03]
    seen = exact(world, *times_s)
    empty = DriftWorld(world.scenario)
    empty.pile = None
    without = exact(empty, *times_s)
    beams = front.beams.angles_rad
    if pile.meshes():
        assert ((without - seen) > 0.3).sum() > 5
    else:
        straight = seen[:, np.abs(beams) < 0.02]
        assert np.median(straight[-1]) > 5.0
    assert (seen <= without + 1e-3).all()  # nothing that stands there makes a range longer


def test_a_drive_ends_where_it_may_and_starts_far_away(world: DriftWorld, truth: PileTruth) -> None:
    first, last = truth.distances_m(world.history.rows[[0, -1], :3])
    assert 38.0 < first < 52.0
    assert 4.0 < last < 10.0
    assert truth.status == {
        "too_shallow": "too_shallow", "wall": "wall", "hang_up": "hang_up", "low_wall": "too_shallow",
        "empty_stope": "none", "side_opening": "none", "machine": "none", "post": "none",
    }.get(truth.variant, "loadable")  # fmt: skip


def test_the_truth_of_a_loadable_pile_is_one(truth: PileTruth) -> None:
    if truth.status == "loadable":
        assert -62.0 < truth.inclination_deg < -30.0
        assert 2.9 < truth.width_m < 5.2
        assert truth.volumes_m3[1.0] < truth.volumes_m3[2.0]
        assert (len(truth.boulders) == 1) == (truth.variant == "boulder")
    if truth.status in ("wall", "hang_up"):
        assert truth.volumes_m3 == {}
        assert truth.inclination_deg < -58.0
    if truth.status == "none":
        assert math.isnan(truth.width_m)
        assert math.isnan(truth.inclination_deg)


def test_a_seed_is_a_scene_and_another_seed_another() -> None:
    assert scene("stope", 5) == scene("stope", 5)
    worlds = [DriftWorld(scene("normal", seed)) for seed in (1, 1, 2)]
    meshes: list[Mesh] = [joined_mesh(one) for one in worlds]
    assert np.array_equal(meshes[0].vertices_m, meshes[1].vertices_m)
    headings = [one.history.rows[0, 5] for one in worlds]
    assert headings[0] == headings[1] != headings[2]
    assert worlds[0].scenario.mounting != worlds[2].scenario.mounting


def joined_mesh(world: DriftWorld) -> Mesh:
    assert world.pile is not None
    return world.pile.joined_to(world.crossing.mesh(0, 50))


def test_start_headings_and_mountings_cover_their_ranges() -> None:
    scenes = [scene("normal", seed) for seed in range(60)]
    headings = [
        DriftWorld.rng(_bare(one), "start").uniform((-20, -20, -2, -math.pi), (20, 20, 2, math.pi)) for one in scenes
    ]
    assert np.histogram(np.array(headings)[:, 3], bins=4, range=(-math.pi, math.pi))[0].min() >= 5
    heights = [one.mounting.height_m for one in scenes if one.mounting is not None]
    assert 1.5 <= min(heights) < 1.6
    assert 2.1 < max(heights) <= 2.2
    errors = [one.mounting.tilt_error_deg for one in scenes if one.mounting is not None]
    assert 20 <= sum(error == 0.0 for error in errors) <= 50


def _bare(scenario: DriftScenario) -> DriftWorld:
    """Return a world that knows its scenario only: enough to ask for its chance."""
    world = object.__new__(DriftWorld)
    world.scenario = scenario
    return world


def test_a_flat_floor_has_no_waves() -> None:
    waves, flat = (DriftWorld(scene("normal", 4, flat_floor=flat)).history.rows[:, 4].std() for flat in (False, True))
    assert flat < waves
    assert scene("normal", 4, flat_floor=True).drift.floor_undulation_m == 0.0


def test_the_log_tells_the_nominal_tilt_and_the_rays_have_the_true_one() -> None:
    base = clean_world().scenario
    world = DriftWorld(replace(base, mounting=MountingSettings(height_m=1.6, tilt_error_deg=1.0)))
    mount = world.machine.mounts["lidar_front"]
    assert (mount.pitch_deg, mount.position_m[2]) == (2.5, 1.6)
    straight = exact(world, 0.0)[0]
    level = straight[len(straight) // 2]
    height = 1.6 - level * math.sin(math.radians(3.5))  # of the hit over the floor
    assert 0.8 + level * math.cos(math.radians(3.5)) == pytest.approx(20.0 + height, abs=0.05)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_scenario_file_holds_all_of_a_scene(variant: str) -> None:
    import tomllib

    scenario = scene(variant, 11)
    assert scenario_from(tomllib.loads(scenario_toml(scenario))) == scenario


def test_wrong_scenes_are_refused() -> None:
    with pytest.raises(UsageError, match="stope"):
        scene("stop", 1)
    with pytest.raises(UsageError, match="-1"):
        scene("stope", -1)
    with pytest.raises(ConfigError, match="planar"):
        replace(scene("wall", 1), planar=True)
    with pytest.raises(ConfigError, match="distance_m"):
        replace(scene("wall", 1), drive=DriveSettings(distance_m=48.0))
