"""Ranges against geometry that is known, and what spoils them against its statistics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from lhdmap.machine import Machine
from lhdmap.simulation.history import START_NS, Column, History
from lhdmap.simulation.scanner import Beams, beams_of, measured, obstructed, rays_of, rig_of, sweep_of
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sensing.sections import ScannerSettings
from lhdmap.simulation.world import DriftWorld

from tests.simulation.conftest import COARSE, SHORT
from tests.simulation.scanners import exact, scanner, stamp


def side_walls(half_width_m: float, angles_rad: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    with np.errstate(divide="ignore"):
        return half_width_m / np.abs(np.sin(angles_rad))


@pytest.mark.parametrize("side", ["front", "rear"])
def test_ranges_in_a_smooth_straight_drift(plain_world: DriftWorld, side: str) -> None:
    ranges = exact(plain_world, 1.0, 4.0, side=side)
    angles = scanner(plain_world, side).beams.angles_rad
    expected = side_walls(2.0, angles)
    beside = np.abs(np.degrees(angles)) > 15.0
    assert np.abs(ranges[:, beside] - expected[beside]).max() < 1e-3


def test_the_end_comes_nearer_as_the_machine_drives(plain_world: DriftWorld) -> None:
    middle = 190
    near, far = exact(plain_world, 5.0, 3.0)[:, middle]
    there, here = (plain_world.history.state(stamp(t)) for t in (5.0, 3.0))
    assert far - near == pytest.approx(float(np.hypot(*(there - here)[:2])), abs=2e-3)


def test_both_sides_see_one_surface(world: DriftWorld) -> None:
    """Exact hits of both scanners, put into the map by the truth, lie on the mesh: mounts and poses are one story."""
    import open3d as o3d

    mesh = world.mesh_between(0.0, world.drift.line.length_m)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices_m.astype(np.float32)), o3d.core.Tensor(mesh.triangles))  # type: ignore[call-overload]
    for side in ("front", "rear"):
        one, times_s = scanner(world, side), (2.0, 5.0, 7.0)
        sweep, ranges = sweep_of(one.beams), exact(world, *times_s, side=side).ravel()
        rays = np.concatenate([rays_of(world.history, stamp(t), sweep, one.rig, np.zeros(3))[0] for t in times_s])
        hits = rays[:, :3] + ranges[:, None] * rays[:, 3:]
        seen = np.isfinite(ranges)
        assert seen.mean() > 0.95
        distance = scene.compute_distance(o3d.core.Tensor(hits[seen])).numpy()  # type: ignore[call-overload]
        assert distance.max() < 1e-3


def test_beams_are_those_of_the_data_sheet() -> None:
    beams = beams_of(ScannerSettings(beams=381, rate_hz=25.0, sweep=True))
    assert math.degrees(beams.angles_rad[0]) == pytest.approx(-95.0)
    assert math.degrees(beams.increment_rad) == pytest.approx(0.5)
    assert beams.time_increment_s == pytest.approx(0.04 * 0.5 / 360.0)
    fine = beams_of(ScannerSettings(beams=761))
    assert math.degrees(fine.increment_rad) == pytest.approx(0.25)
    assert fine.time_increment_s == 0.0


def test_sweep_measures_each_beam_at_its_own_time(scenario: DriftScenario) -> None:
    fast = replace(scenario, drive=replace(SHORT, speed_kmh=24.0, acceleration_mps2=4.0))
    still = DriftWorld(fast)
    swept = DriftWorld(replace(fast, scanner=replace(fast.scanner, sweep=True)))
    ranges, times_s = exact(swept, 3.0)[0], scanner(swept).beams.times_s
    for beam in (0, 100, 250, 380):
        assert exact(still, 3.0 + float(times_s[beam]))[0, beam] == pytest.approx(ranges[beam], abs=1e-4)
    distortion = np.abs(ranges - exact(still, 3.0)[0])
    assert np.median(distortion[300:]) > 0.012  # more than the noise of a range


def noisy(settings: ScannerSettings, exact_m: float = 5.0) -> npt.NDArray[np.float32]:
    true = np.full((200, 381), exact_m, dtype=np.float32)
    return measured(true, settings, np.full(200, settings.dust_share), np.random.default_rng(3))


@pytest.mark.parametrize("noise_m", [0.005, 0.012, 0.025])
def test_range_noise_has_its_size_and_no_bias(noise_m: float) -> None:
    error = noisy(ScannerSettings(noise_m=noise_m)) - 5.0
    assert error.std() == pytest.approx(noise_m, rel=0.02)
    assert error.mean() == pytest.approx(0.0, abs=4 * noise_m / math.sqrt(error.size))


def test_what_is_out_of_range_is_no_return() -> None:
    assert np.isinf(noisy(ScannerSettings(max_range_m=4.0))).all()
    assert np.isinf(noisy(ScannerSettings(min_range_m=1.0), exact_m=0.5)).all()


def test_drop_outs_and_dust_have_their_share() -> None:
    dropped = np.isinf(noisy(ScannerSettings(drop_out_share=0.02))).mean()
    assert dropped == pytest.approx(0.02, rel=0.1)
    ranges = noisy(ScannerSettings(dust_share=0.1))
    early = (ranges < 4.8).mean()
    assert early == pytest.approx(0.1 * (1 - math.exp(-(4.8 - 0.5) / 3.0)), rel=0.1)
    assert ranges.max() < 5.1


def test_mixed_pixels_lie_between_the_two_surfaces() -> None:
    exact = np.full((500, 100), 3.0, dtype=np.float32)
    exact[:, 50:] = 8.0
    ranges = measured(
        exact, ScannerSettings(noise_m=0.0, mixed_pixel_share=0.4), np.zeros(500), np.random.default_rng(0)
    )
    changed = ranges != exact
    sides = changed[:, 49:51].mean(axis=0)
    assert sides.sum() == pytest.approx(0.4, abs=0.07)
    assert sides == pytest.approx([0.2, 0.2], abs=0.06)
    assert not changed[:, :49].any()
    assert not changed[:, 51:].any()
    between = ranges[changed]
    assert between.min() > 3.0
    assert between.max() < 8.0
    assert between.mean() == pytest.approx(5.5, abs=0.4)


def test_a_wall_seen_at_a_grazing_angle_has_no_mixed_pixels() -> None:
    """Its beams are metres apart in range, yet no edge: they hit one surface."""
    exact = np.repeat(2.0 / np.sin(np.radians(np.arange(2.0, 90.0, 0.5)))[None], 50, axis=0).astype(np.float32)
    assert np.abs(np.diff(exact[0])).max() > 3.0
    settings = ScannerSettings(noise_m=0.0, mixed_pixel_share=1.0)
    assert (measured(exact, settings, np.zeros(50), np.random.default_rng(0)) == exact).all()


def test_a_person_hides_beams_and_a_blackout_all() -> None:
    settings = ScannerSettings(person=((2.0, 1.0, 0.5),), blackouts=((4.0, 3.0),))
    ranges = obstructed(np.full((10, 381), 5.0, dtype=np.float32), np.arange(10.0), settings)
    assert (ranges[2] < 2.0).mean() == pytest.approx(0.5, abs=0.01)
    assert np.isinf(ranges[4:7]).all()
    assert (ranges[[0, 1, 3, 7, 8, 9]] == 5.0).all()


def blocked_by(machine: Machine, mount: str, bend_rad: float, angle_deg: float) -> float:
    rows = np.zeros((2, len(Column)))
    rows[:, Column.ARTICULATION] = bend_rad
    beams = Beams(np.radians([angle_deg, angle_deg + 0.5]), np.zeros(2))
    rig = rig_of(machine, machine.mounts[mount], occlusion=True)
    return float(rays_of(History(100.0, rows), START_NS, sweep_of(beams), rig, np.zeros(3))[1][0])


def test_own_bodies_hide_what_is_behind_them() -> None:
    default = Machine()
    low = replace(default.mounts["lidar_front"], position_m=(0.8, 0.0, 1.2), pitch_deg=0.0)
    beside = replace(default.mounts["lidar_front"], position_m=(-1.2, 1.4, 1.0), pitch_deg=0.0)
    machine = replace(default, mounts={"low": low, "beside": beside, **default.mounts})
    assert blocked_by(machine, "low", 0.0, 0.0) == pytest.approx(0.2)  # the boom begins 1.0 m ahead of the axle
    assert math.isinf(blocked_by(machine, "lidar_front", 0.0, 0.0))
    # The rear body comes to lie behind a scanner on the left flank when the machine bends to the left.
    assert math.isinf(blocked_by(machine, "beside", 0.0, 179.0))
    assert blocked_by(machine, "beside", 0.6, 179.0) < 2.0
    assert math.isinf(blocked_by(machine, "beside", -0.6, 179.0))


@pytest.mark.parametrize("mount", ["lidar_front", "lidar_rear"])
@pytest.mark.parametrize("bend_deg", [-40.0, 0.0, 40.0])
def test_the_default_scanners_see_past_the_machine(mount: str, bend_deg: float) -> None:
    for angle_deg in np.arange(-95.0, 95.1, 1.0):
        assert math.isinf(blocked_by(Machine(), mount, math.radians(bend_deg), float(angle_deg)))


def test_long_drifts_are_cast_in_tiles_without_a_trace(scenario: DriftScenario) -> None:
    """A scan near a tile's border is the same whichever tile it is cast in."""
    world = DriftWorld(replace(scenario, drift=replace(COARSE, mesh_m=0.2), drive=replace(SHORT, distance_m=220.0)))
    one, at_ns = scanner(world), stamp(12.0)
    place = world.place_m(world.history.state(at_ns)[:3])
    ranges = []
    for s_m in (place, place - 60.0, place + 60.0):
        surface = world.surface.near(s_m)
        ranges.append(surface.cast(rays_of(world.history, at_ns, sweep_of(one.beams), one.rig, surface.origin_m)[0]))
    assert np.allclose(ranges[0], exact(world, 12.0)[0])
    for other in ranges[1:]:
        assert np.abs(other - ranges[0]).max() < 1e-3


def test_a_place_is_found_along_the_drift(world: DriftWorld) -> None:
    line = world.drift.line
    for k in range(0, len(line.s_m), 137):
        beside = np.array([line.x_m[k] + 0.3, line.y_m[k] - 0.4, line.z_m[k] + 0.1])
        assert world.place_m(beside) == pytest.approx(line.s_m[k], abs=0.8)
