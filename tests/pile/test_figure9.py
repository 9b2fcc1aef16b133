"""The paper's algorithm (Fig. 9): tested for what it does, not for finding piles, which as printed it does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry.se3 import from_rpy
from lhdmap.messages import FloatArray
from lhdmap.pile.figure9 import stage as figure9_stage
from lhdmap.pile.figure9.fit import largest_cluster, plane_inclination_deg, voxelised
from lhdmap.pile.figure9.method import (
    distance_to_center_m,
    drift_heading_rad,
    figure9,
    loop_ends,
    mean_normal_inclination_deg,
    segment,
)
from lhdmap.pile.figure9.settings import Figure9Constants, RepairedConstants
from lhdmap.pile.result import PileEstimate
from lhdmap.pile.settings import PileSettings
from lhdmap.pile.slope_status import status_of, status_probabilities
from lhdmap.pile.stage import ScanHits
from lhdmap.settings import load_section

from tests.pile.piled_drift import TOE_M, PiledDrift

PRINTED, REPAIRED = Figure9Constants(), RepairedConstants()
LENIENT = replace(PRINTED, curvature_min=0.0, neighbours_min=0, ny_max=1.0)


def _blob(seed: int, n: int = 400) -> FloatArray:
    return np.random.default_rng(seed).normal([12.0, 0.0, 1.0], [1.5, 1.0, 0.7], (n, 3))


def test_printed_constants_are_those_of_the_paper() -> None:
    assert PRINTED.voxel_size_m == (0.2, 0.2, 0.1)
    assert (PRINTED.normal_radius_m, PRINTED.slope_radius_m, PRINTED.deadline_m) == (0.75, 3.0, 15.0)
    assert (PRINTED.ny_max, PRINTED.curvature_min, PRINTED.curvature_max) == (0.3, 0.05, 0.4)
    assert (PRINTED.neighbours_min, PRINTED.points_min, PRINTED.waits) == (80, 100, False)
    assert (REPAIRED.ny_max, REPAIRED.nz_max, REPAIRED.neighbours_min, REPAIRED.waits) == (0.5, 0.92, 40, True)


def test_constants_are_a_section_of_settings() -> None:
    assert load_section(RepairedConstants, "figure9_repaired", {"ny_max": 0.4}).ny_max == 0.4
    assert load_section(Figure9Constants, "figure9", {}) == PRINTED


@pytest.mark.parametrize("slope_deg", [30.0, 50.0, 75.0])
def test_normals_are_those_of_the_planes_and_look_at_the_machine(slope_deg: float) -> None:
    drift = PiledDrift(slope_deg=slope_deg)
    found = segment(drift.cloud(), drift.T_map_base(), PRINTED)
    x, y, z = found.points_map.T
    angle = math.radians(slope_deg)
    onto_face = (x - TOE_M) * math.sin(angle) - z * math.cos(angle)
    places = {
        "face": (np.abs(onto_face) < 0.02) & (np.abs(y) < 1.2) & (z > 0.85),
        "floor": (z < 0.02) & (np.abs(y) < 1.2) & (x < TOE_M - 0.8),
        "left": (y > 1.9) & (z > 0.85) & (x < TOE_M - 0.8),
        "right": (y < -1.9) & (z > 0.85) & (x < TOE_M - 0.8),
    }
    wanted = {"face": (-math.sin(angle), 0.0, math.cos(angle)), "floor": (0.0, 0.0, 1.0)}
    wanted |= {"left": (0.0, -1.0, 0.0), "right": (0.0, 1.0, 0.0)}
    for name, where in places.items():
        assert np.count_nonzero(where) > 10, name
        np.testing.assert_allclose(
            found.normals[where], np.tile(wanted[name], (where.sum(), 1)), atol=0.06, err_msg=name
        )


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_surface_variation_is_at_most_a_third_so_the_upper_bound_never_acts(seed: int) -> None:
    points = _blob(seed)
    found = segment(points, np.eye(4), LENIENT)
    assert found.curvature.max() <= 1.0 / 3.0 + 1e-6
    unbounded = segment(points, np.eye(4), replace(LENIENT, curvature_max=1.0))
    np.testing.assert_array_equal(found.pile, unbounded.pile)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["remaining", "cloud"]))
def test_neighbour_counts_agree_with_brute_force(seed: int, where: str) -> None:
    constants = replace(PRINTED, neighbours_in=where, neighbours_min=12, curvature_min=0.02)
    found = segment(_blob(seed), np.eye(4), constants)
    points = found.points_map
    known = found.normals.any(axis=1)
    left = known & (np.abs(found.normals[:, 1]) <= 0.3) & (found.curvature >= 0.02) & (found.curvature <= 0.4)
    among = left if where == "remaining" else np.ones(len(points), dtype=bool)
    distances = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    near = (distances <= 0.75) & among[None, :] & ~np.eye(len(points), dtype=bool)
    counts = np.where(left, near.sum(axis=1), 0)
    np.testing.assert_array_equal(found.neighbours, counts)
    np.testing.assert_array_equal(found.pile, left & (counts >= 12))


@pytest.mark.parametrize("slope_deg", [27.0, 38.0, 50.0, 62.0])
@pytest.mark.parametrize("rubble_m", [0.0, 0.03])
def test_as_printed_nothing_is_declared_on_a_clean_pile(slope_deg: float, rubble_m: float) -> None:
    drift = PiledDrift(slope_deg=slope_deg, rubble_m=rubble_m)
    found = figure9(drift.cloud(), drift.T_map_base())
    assert found.status == "none"
    assert not found.found


@pytest.mark.parametrize(
    ("slope_deg", "status"),
    [(26.0, "too_shallow"), (50.0, "loadable"), (70.0, "hang_up"), (89.0, "wall"), (105.0, "hang_up")],
)
@pytest.mark.parametrize("heading_rad", [0.0, 0.6, math.pi, -2.0])
def test_repaired_finds_the_pile_with_table_6_sign_at_any_heading(
    slope_deg: float, status: str, heading_rad: float
) -> None:
    drift = PiledDrift(slope_deg=slope_deg, heading_rad=heading_rad)
    found = figure9(drift.cloud(), drift.T_map_base(), REPAIRED)
    assert found.status == status
    assert found.inclination_deg == pytest.approx(-slope_deg, abs=0.5)
    # Known bias: at the walls the normals over 0.75 m turn away from the pile's, and the bounds lie inside.
    assert drift.width_m - 0.7 < found.width_m < drift.width_m
    left, right = (limit @ drift.R_map_drift for limit in (found.left_limit_m, found.right_limit_m))
    assert left[1] > 1.4
    assert right[1] < -1.4
    assert len(found.face_m) == len(found.residuals_m) >= 100
    toe = found.toe_m @ drift.R_map_drift
    assert np.all(np.diff(toe[:, 1]) < 0)
    assert np.median(toe[:, 2]) < 0.9  # where the slope is 26 deg, normals near the toe are the floor's


def test_n_y_is_taken_in_the_axes_of_the_map_as_printed() -> None:
    constants = replace(REPAIRED, axes="map")
    along, across = PiledDrift(), PiledDrift(heading_rad=math.pi / 2)
    assert figure9(along.cloud(), along.T_map_base(), constants).status == "loadable"
    assert figure9(across.cloud(), across.T_map_base(), constants).inclination_deg != pytest.approx(-50.0, abs=5.0)


def test_one_stray_point_moves_the_printed_bounds_and_not_the_robust_ones() -> None:
    drift = PiledDrift()
    face = drift.face()
    stray = np.concatenate([face, [[TOE_M + 0.5, 3.4, 0.5]]])
    printed = replace(LENIENT, curvature_max=1.0)
    robust = replace(printed, bound_share=0.03)
    clean = figure9(face, drift.T_map_base(), printed).width_m
    assert clean == pytest.approx(3.9, abs=0.1)
    # The stray has no neighbours, hence no normal; give it some, as a spilled rock has.
    stray = np.concatenate([stray, stray[-1] + np.random.default_rng(1).normal(0.0, 0.1, (8, 3))])
    assert figure9(stray, drift.T_map_base(), printed).width_m > clean + 1.0
    assert figure9(stray, drift.T_map_base(), robust).width_m == pytest.approx(clean, abs=0.3)


@settings(max_examples=30, deadline=None)
@given(st.floats(5.0, 120.0))
def test_inclination_of_a_plane_is_exact_for_both_fits(slope_deg: float) -> None:
    angle = math.radians(slope_deg)
    up, across = np.meshgrid(np.arange(0.0, 2.0, 0.1), np.arange(-1.5, 1.5, 0.1))
    plane = np.column_stack([20.0 + up.ravel() * math.cos(angle), across.ravel(), up.ravel() * math.sin(angle)])
    assert plane_inclination_deg(plane) == pytest.approx(-slope_deg, abs=1e-3)
    view = plane.mean(axis=0) + 10.0 * np.array([-math.sin(angle), 0.0, math.cos(angle)])
    assert mean_normal_inclination_deg(plane, 3.0, view) == pytest.approx(-slope_deg, abs=1e-2)


def test_final_normals_with_floor_and_walls_among_them_are_far_off() -> None:
    drift = PiledDrift()
    view = drift.T_map_base()[:3, 3] + [0.0, 0.0, 2.0]
    alone = mean_normal_inclination_deg(drift.face(), 3.0, view)
    everything = drift.cloud()
    near = everything[everything[:, 0] > TOE_M - 1.5]
    assert alone == pytest.approx(-50.0, abs=0.1)
    assert abs(mean_normal_inclination_deg(near, 3.0, view) + 50.0) > 15.0


def test_robust_plane_leaves_a_boulder_out() -> None:
    face = PiledDrift().face()
    boulder = (np.abs(face[:, 1] - 0.5) < 0.4) & (np.abs(face[:, 2] - 1.2) < 0.4)
    face[boulder, 0] -= 0.6
    assert plane_inclination_deg(face) == pytest.approx(-50.0, abs=0.2)


def test_plane_of_points_on_a_line_is_not_known() -> None:
    line = np.column_stack([np.arange(50.0), np.zeros(50), np.zeros(50)])
    assert math.isnan(plane_inclination_deg(line))


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, -2.5, math.pi])
@pytest.mark.parametrize("askew_rad", [-0.3, 0.0, 0.3])
def test_drift_heading_is_that_of_the_walls_not_of_the_machine(heading_rad: float, askew_rad: float) -> None:
    drift = PiledDrift(heading_rad=heading_rad)
    T_map_base = drift.T_map_base()
    T_map_base[:3, :3] = T_map_base[:3, :3] @ from_rpy(0.0, 0.0, askew_rad)[:3, :3]
    found = segment(drift.cloud(), T_map_base, REPAIRED)
    off = math.remainder(found.heading_rad - heading_rad, 2.0 * math.pi)
    assert abs(math.degrees(off)) < 1.0


def test_drift_heading_without_walls_is_the_machine_s() -> None:
    T_map_base = from_rpy(0.0, 0.0, 0.7)
    assert drift_heading_rad(np.zeros((0, 3)), np.zeros((0, 3)), T_map_base) == pytest.approx(0.7)


def test_loop_ends_at_100_points_as_printed_and_at_15_m_when_it_waits() -> None:
    def of(points: int) -> PileEstimate:
        return PileEstimate(face_m=np.tile([40.0, 0.0, 0.0], (points, 1)))

    far, near = np.eye(4), from_rpy(0.0, 0.0, 0.0, (25.5, 0.0, 0.0))
    assert distance_to_center_m(of(5), far) == 40.0
    assert [loop_ends(of(n), far, PRINTED) for n in (0, 1, 99, 100)] == [False, False, False, True]
    assert [loop_ends(of(n), near, PRINTED) for n in (0, 1, 99, 100)] == [False, True, True, True]
    assert [loop_ends(of(n), far, REPAIRED) for n in (0, 1, 99, 100)] == [False, False, False, False]
    assert [loop_ends(of(n), near, REPAIRED) for n in (0, 1, 99, 100)] == [False, True, True, True]


def test_a_stage_judges_what_is_near_the_machine_however_long_the_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[FloatArray] = []

    def watched(points: FloatArray, *_: object) -> PileEstimate:
        judged.append(points)
        return PileEstimate()

    monkeypatch.setattr(figure9_stage, "figure9", watched)
    stage = figure9_stage.Figure9Stage(PileSettings(reach_m=20.0), PRINTED)
    section = np.stack(np.meshgrid(np.arange(0.0, 12.0, 0.3), [-2.0, 2.0], [0.5, 1.0]), -1).reshape(-1, 3)
    for number in range(400):
        place = np.array([0.5 * number, 0.0, 0.0, 0.0])
        stage.update(ScanHits(number, section + place[:3], place))
        assert np.abs(judged[-1][:, 0] - place[0]).max() < 20.0
    assert len(judged) == 400
    assert max(map(len, judged[200:])) < 1.02 * max(map(len, judged[:200]))
    assert judged[-1][:, 0].min() < place[0] - 19.0


def test_status_by_thresholds() -> None:
    said = [status_of(-slope, PRINTED.bounds) for slope in (10.0, 27.9, 28.0, 60.0, 70.0, 81.0, 98.0, 99.0)]
    assert said == ["too_shallow", "too_shallow", "loadable", "loadable", "hang_up", "wall", "wall", "hang_up"]


@given(st.floats(0.0, 130.0), st.floats(0.0, 20.0))
def test_probabilities_of_statuses_add_up_and_favour_the_one_by_threshold(slope_deg: float, std_deg: float) -> None:
    share = status_probabilities(-slope_deg, std_deg, PRINTED.bounds)
    assert sum(share.values()) == pytest.approx(1.0)
    assert min(share.values()) >= -1e-12
    bounds = np.array([PRINTED.shallow_deg, PRINTED.steep_deg, PRINTED.wall_deg, PRINTED.overhang_deg])
    if np.abs(bounds - slope_deg).min() > 3.0 and std_deg < 1.0:
        assert max(share, key=lambda name: share[name]) == status_of(-slope_deg, PRINTED.bounds)


@pytest.mark.parametrize("constants", [PRINTED, REPAIRED])
@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.ones((1, 3)), np.full((5, 3), np.nan), np.ones((200, 3))])
def test_clouds_without_a_surface_hold_no_pile(constants: Figure9Constants, points: FloatArray) -> None:
    assert figure9(points, np.eye(4), constants).status == "none"


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(20, 200))
def test_voxel_grid_keeps_the_mass_and_is_idempotent(seed: int, n: int) -> None:
    points = np.random.default_rng(seed).uniform(-3.0, 3.0, (n, 3))
    size = (0.2, 0.2, 0.1)
    once = voxelised(points, size)
    cells = np.unique(np.floor(points / np.asarray(size)), axis=0)
    assert len(once) == len(cells)
    np.testing.assert_allclose(np.sort(voxelised(once, size), axis=0), np.sort(once, axis=0), atol=1e-12)


def test_largest_cluster_is_the_one_with_most_points() -> None:
    row = np.column_stack([np.arange(30) * 0.1, np.zeros(30), np.zeros(30)])
    small = row[:10] + np.array([10.0, 0.0, 0.0])
    found = largest_cluster(np.concatenate([small, row]), 0.15)
    np.testing.assert_array_equal(found, np.arange(40) >= 10)
    assert largest_cluster(np.zeros((0, 3)), 0.5).shape == (0,)
