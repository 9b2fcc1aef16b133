"""The drift's surface: size, roughness, closure, openings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.mine.centre_line import Start, beside, centre_line
from lhdmap.simulation.crossing import Crossing, side_drift
from lhdmap.simulation.drift import Drift, Mesh
from lhdmap.simulation.noise_field import Scales, noise_field
from lhdmap.simulation.raycast import Surface
from lhdmap.simulation.sections import DriftSettings

START = Start(5.0, -3.0, 1.0, 0.7)


def make_drift(
    *,
    seed: int = 0,
    length_m: float = 50.0,
    pieces: tuple[tuple[float, float, float], ...] = ((60.0, 0.0, 0.0),),
    **changes: float | str,
) -> Drift:
    drift = replace(DriftSettings(mesh_m=0.1, pieces=pieces), **changes)  # type: ignore[arg-type]
    return Drift(drift, centre_line(pieces, length_m, 2.0, START), np.random.default_rng(seed))


def in_line_frame(drift: Drift, mesh: Mesh) -> FloatArray:
    """Vertices of a straight, level drift as along, lateral, height."""
    forward = np.array([math.cos(START.heading_rad), math.sin(START.heading_rad)])
    xy = mesh.vertices_m[:, :2] - [START.x_m, START.y_m]
    return np.column_stack([xy @ forward, xy @ [-forward[1], forward[0]], mesh.vertices_m[:, 2] - START.z_m])


@pytest.mark.parametrize("rms_m", [0.12, 0.03, 0.005])
@pytest.mark.parametrize("profile", ["arched", "box"])
def test_walls_have_the_width_and_roughness_asked_for(rms_m: float, profile: str) -> None:
    drift = make_drift(roughness_m=rms_m, profile=profile, floor_undulation_m=0.0, floor_roughness_m=0.0)
    points = in_line_frame(drift, drift.mesh(0, drift.ring_count()))
    band = points[(points[:, 2] > 0.4) & (points[:, 2] < 1.6)]
    left, right = band[band[:, 1] > 0.5, 1], band[band[:, 1] < -0.5, 1]
    assert left.mean() - right.mean() == pytest.approx(4.0, abs=max(0.8 * rms_m, 0.002))
    both = np.concatenate([left - 2.0, -right - 2.0])
    assert math.sqrt(np.mean(both**2)) == pytest.approx(rms_m, rel=0.25)
    assert points[:, 2].max() == pytest.approx(3.8, abs=5 * rms_m)


def test_the_floor_waves_as_asked_and_a_smooth_one_is_flat() -> None:
    drift = make_drift(floor_undulation_m=0.04, floor_roughness_m=0.01)
    points = in_line_frame(drift, drift.mesh(0, drift.ring_count()))
    floor = points[(np.abs(points[:, 1]) < 1.5) & (points[:, 2] < 0.5), 2]
    assert floor.std() == pytest.approx(math.hypot(0.04, 0.01), rel=0.15)
    flat = make_drift(floor_undulation_m=0.0, floor_roughness_m=0.0)
    heights = in_line_frame(flat, flat.mesh(0, 50))[:, 2]
    assert np.isclose(heights, 0.0, atol=1e-12).sum() > 50 * 30


def test_roughness_has_its_six_scales() -> None:
    """Differences over half a knot spacing grow with the gain: white noise or one wave would not."""
    drift = make_drift(length_m=200.0, roughness_m=0.12)
    s = np.arange(0.0, 200.0, 0.02)
    wall = drift.wall_offset(s)[:, 10]
    spread = [float(np.std(wall[lag:] - wall[:-lag])) for lag in (2, 8, 32, 128)]  # 4 cm to 2.6 m
    assert spread[0] < 0.6 * spread[1] < 0.4 * spread[2]
    assert spread[3] == pytest.approx(0.12 * math.sqrt(2), rel=0.3)


def test_blast_rounds_widen_and_step_back() -> None:
    drift = make_drift(roughness_m=0.0, blast_flare_m=0.2, blast_round_m=4.0)
    mean = drift.wall_offset(np.array([0.0, 1.9, 3.8, 4.0, 7.8])).mean(axis=1)
    assert mean == pytest.approx([-0.1, 0.2 * (1.9 / 3.85 - 0.5), 0.2 * (3.8 / 3.85 - 0.5), -0.1, mean[2]], abs=1e-6)


def test_a_piece_of_the_mesh_is_the_same_in_any_piece() -> None:
    drift = make_drift()
    whole, piece = drift.mesh(0, 60), drift.mesh(20, 40)
    count = len(piece.vertices_m) // 20
    assert np.array_equal(whole.vertices_m[20 * count : 40 * count], piece.vertices_m)


def test_bends_turn_by_their_angle_and_grades_climb() -> None:
    line = centre_line(((20.0, 0.0, 10.0), (9.0 * math.pi / 2, 9.0, 0.0), (20.0, 0.0, 0.0)), 50.0, 3.0, START)
    assert line.heading_rad[-1] - line.heading_rad[0] == pytest.approx(math.pi / 2, abs=0.01)
    assert line.curvature_pm.max() == pytest.approx(1 / 9.0)
    assert line.z_m[-1] - line.z_m[0] == pytest.approx(2.0, abs=0.02)
    assert np.hypot(np.diff(line.x_m), np.diff(line.y_m)) == pytest.approx(0.01, rel=1e-4)


def test_a_path_beside_the_line_runs_along_its_own_heading() -> None:
    line = centre_line(((10.0, 0.0, 0.0), (20.0, 12.0, 0.0)), 50.0, 3.0, START)
    path = beside(line, 0.3 * np.sin(line.s_m / 3.0))
    step_x, step_y = np.gradient(path.x_m, 0.01), np.gradient(path.y_m, 0.01)
    side = -step_x * np.sin(path.heading_rad) + step_y * np.cos(path.heading_rad)
    assert np.abs(side[2:-2]).max() < 1e-3
    assert np.hypot(step_x, step_y)[2:-2] == pytest.approx(1.0, abs=1e-3)


def rays_from(points_m: FloatArray, surface: Surface, rng: np.random.Generator, count: int) -> Float32Array:
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts = points_m[rng.integers(0, len(points_m), count)] - surface.origin_m
    return np.hstack([starts, directions]).astype(np.float32)


@pytest.mark.parametrize("openings", [(), ((25.0, 70.0, 12.0), (25.0, -90.0, 12.0))])
def test_no_ray_leaves_the_drift(openings: tuple[tuple[float, float, float], ...]) -> None:
    pieces = ((15.0, 0.0, -8.0), (10.0, 12.0, 5.0), (10.0, -9.0, 0.0))
    main = make_drift(pieces=pieces)
    rng = np.random.default_rng(1)
    crossing = Crossing(main, [side_drift(main, opening, rng) for opening in openings])
    surface = Surface(crossing.mesh(0, main.ring_count()))
    points = np.stack([main.line.x_m, main.line.y_m, main.line.z_m + 1.8], axis=1)[200:-200:50]
    assert np.isfinite(surface.cast(rays_from(points, surface, rng, 40_000))).all()


def test_an_opening_can_be_looked_into() -> None:
    main = make_drift(roughness_m=0.03)
    crossing = Crossing(main, [side_drift(main, (25.0, 90.0, 15.0), np.random.default_rng(1))])
    heading = START.heading_rad + math.pi / 2
    for s_m, expected_m in ((25.0, 15.0), (15.0, 2.0)):
        x, y, z, _ = main.line.at(np.array([s_m]))[0]
        surface = Surface(crossing.mesh(0, main.ring_count()))
        ray = np.array([[x, y, z + 1.8, math.cos(heading), math.sin(heading), 0.0]])
        ray[:, :3] -= surface.origin_m
        assert surface.cast(ray.astype(np.float32))[0] == pytest.approx(expected_m, abs=0.5)


@settings(max_examples=25, deadline=None)
@given(s=st.floats(0.0, 30.0), u=st.floats(0.0, 9.0), seed=st.integers(0, 5))
def test_a_field_is_one_function_however_it_is_asked(s: float, u: float, seed: int) -> None:
    field = noise_field(np.random.default_rng(seed), Scales(4, 2.0, 0.6), (0.0, 30.0), (0.0, 9.0))
    value = field.at(np.array([s]), np.array([u]))[0]
    assert field.grid(np.array([s]), np.array([u]))[0, 0] == pytest.approx(value, abs=1e-12)
    assert abs(field.at(np.array([s + 1e-4]), np.array([u]))[0] - value) < 0.01


def test_a_field_has_the_mean_and_deviation_it_is_normalised_to() -> None:
    field = noise_field(np.random.default_rng(0), Scales(6, 2.0, 0.7), (0.0, 40.0), (0.0, 10.0))
    assert field.grid(np.arange(0, 40, 0.1), np.arange(0, 10, 0.1)).std() == pytest.approx(1.0, abs=0.15)
    field.normalise(np.arange(0, 40, 0.1), np.arange(0, 10, 0.1), 0.05)
    values = field.grid(np.arange(0.05, 40, 0.1), np.arange(0.05, 10, 0.1))
    assert values.std() == pytest.approx(0.05, rel=0.03)
    assert values.mean() == pytest.approx(0.0, abs=0.002)
