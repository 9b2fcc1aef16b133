"""Scan to map and the wide search: they end at the true pose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.equations import normal_equations, solve3
from lhdmap.scan_matching.matching import NO_SLANTS, Hits, MatchModel, Prior, match
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.search import SearchGrid, search
from lhdmap.scan_matching.surface_map import LINE, SurfaceMap, empty_map, insert_all

from tests.odometry.planar_drives import LEVEL, drive

MODEL = MatchModel(0.012, 3.0, 4.0, 0.05, 6)
LAST = 100
NO_PRIOR = np.diag([1e-2, 1e-2, 1e-1])


def hits(index: int) -> FloatArray:
    return planar_points(drive()[1][index], LEVEL, np.zeros(3))


def seen(index: int) -> Hits:
    return Hits(hits(index), len(hits(index)), layered=False)


@pytest.fixture(scope="module")
def walls() -> SurfaceMap:
    """A map of a stretch of the drift, made of scans at their true poses."""
    map_ = empty_map(0.025, 1024)
    for index in range(LAST - 30, LAST):
        insert_all(map_, se2.transform(drive()[0][index], hits(index)), 50.0)
    return map_


@pytest.mark.parametrize("seed", range(6))
def test_matching_ends_at_the_true_pose(walls: SurfaceMap, seed: int) -> None:
    true, rng = drive()[0][LAST], np.random.default_rng(seed)
    start = true + rng.uniform(-1.0, 1.0, 3) * np.array([0.05, 0.05, math.radians(1.0)])
    found = match(walls, seen(LAST), Prior(start, NO_PRIOR), start, MODEL)
    error = se2.between(true, found.pose)
    assert np.hypot(error[0], error[1]) < 0.004
    assert abs(math.degrees(error[2])) < 0.05
    assert found.support > 0.8


def test_information_tells_the_errors_size(walls: SurfaceMap) -> None:
    found = match(walls, seen(LAST), Prior(drive()[0][LAST], NO_PRIOR), drive()[0][LAST], MODEL)
    assert np.linalg.eigvalsh(found.information).min() > 0.0
    error = found.pose - drive()[0][LAST]
    assert error @ found.information @ error < 60.0  # three degrees of freedom; the map's own error comes on top


@pytest.mark.parametrize("turn_deg", [-30.0, 0.0, 30.0])
@pytest.mark.parametrize("shift_m", [-0.75, 0.0, 0.75])
def test_search_finds_far_starts(walls: SurfaceMap, shift_m: float, turn_deg: float) -> None:
    true = drive()[0][LAST]
    predicted = se2.compose(true, np.array([shift_m, 0.0, math.radians(turn_deg)]))
    recent = np.concatenate([se2.transform(drive()[0][k], hits(k)) for k in range(LAST - 12, LAST)])
    reach = np.array([1.0, math.radians(40.0)])
    starts = search(recent, hits(LAST)[::3], predicted, 1e-3 * np.eye(3), reach, SearchGrid())
    tried = [match(walls, seen(LAST), Prior(start, NO_PRIOR), start, MODEL) for start in starts]
    error = se2.between(true, max(tried, key=lambda one: one.support).pose)
    assert np.hypot(error[0], error[1]) < 0.01
    assert abs(math.degrees(error[2])) < 0.1


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=12, max_size=12))
def test_the_solver_is_that_of_numpy(values: list[float]) -> None:
    J = np.array(values[:9]).reshape(3, 3)
    A, b = J @ J.T + 0.1 * np.eye(3), np.array(values[9:])
    assert solve3(A, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-6, abs=1e-9)


def test_the_solver_says_nothing_of_a_singular_system() -> None:
    assert (solve3(np.zeros((3, 3)), np.ones(3)) == 0.0).all()


def test_the_lean_of_a_patch_is_one_unknown_more() -> None:
    """Eliminating the lean gives what a least squares with all unknowns gives."""
    rng = np.random.default_rng(3)
    count, pose = 60, np.zeros(3)
    points = np.column_stack([rng.uniform(3.0, 3.5, (count, 2)), np.zeros(count)])
    lines = np.zeros((count, LINE))
    normal = rng.uniform(0.2, 1.0, (count, 2))
    lines[:, 2:4] = normal / np.linalg.norm(normal, axis=1)[:, None]
    lines[:, :2] = points[:, :2] + rng.normal(0.0, 0.01, (count, 2))
    lines[:, 4], lines[:, 5], lines[:, 6] = 1e-4, 8.0, 0.025
    lines[:, 7] = rng.normal(0.03, 0.02, count)
    model = MODEL._replace(lean=0.2, lean_patch_m=5.0, cutoff_sigmas=1e6)
    H, b = np.zeros((3, 3)), np.zeros(3)
    normal_equations(pose, Hits(points, count, True, np.zeros((count, 2))), lines, 0.025, model, H, b)
    n = lines[:, 2:4]
    d = (n * (points[:, :2] - lines[:, :2])).sum(axis=1)
    beams = (n * points[:, :2]).sum(axis=1) ** 2 / (points[:, :2] ** 2).sum(axis=1)
    w = 1.0 / (model.noise_m**2 * beams + 1e-4 * (1.0 + 1.0 / 8.0) + 1e-6)
    J = np.column_stack([n, n[:, 1] * points[:, 0] - n[:, 0] * points[:, 1], -lines[:, 7]])
    full = J.T @ (w[:, None] * J) + np.diag([0.0, 0.0, 0.0, 1.0 / 0.2**2])
    expected = np.linalg.solve(full, -J.T @ (w * d))[:3]
    assert np.linalg.solve(H, b) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_hits_without_slants_are_compared_where_they_are() -> None:
    """A tilted scan of which no slants are known is matched as with slants of zero, not with what lies behind the array."""
    count, lines = 40, np.zeros((40, LINE))
    points = np.column_stack([np.linspace(2.0, 4.0, count), np.full(count, 2.0), np.zeros(count)])
    lines[:, 0], lines[:, 1], lines[:, 3] = points[:, 0], 2.01, 1.0
    lines[:, 4], lines[:, 5], lines[:, 6], lines[:, 7] = 1e-4, 8.0, 0.025, 0.04
    found = []
    for slants in (NO_SLANTS, np.zeros((count, 2))):
        H, b = np.zeros((3, 3)), np.zeros(3)
        normal_equations(np.zeros(3), Hits(points, count, True, slants), lines, 0.025, MODEL, H, b)
        found.append((H, b))
    assert (found[0][0] == found[1][0]).all()
    assert (found[0][1] == found[1][1]).all()
    assert found[0][1][1] > 0.0  # towards the wall
