"""The service on places whose walls are known: what it finds, how well it says it knows it, what it cannot know."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.information import body_information, marginal_information
from lhdmap.scan_matching.matching import Hits, Prior
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.submap import Submap, unsure

from tests.odometry.planar_drives import LEVEL, drive
from tests.scan_matching.rooms import (
    CELL_M,
    NICHE_M,
    SHORT,
    hall,
    mapped,
    near,
    off,
    repeating,
    scans,
    seen,
    smooth,
    walk,
)

TRUE = np.array([0.6, -1.1, 0.35])
PLACES = np.array([[0.0, -1.5, 0.0], [0.5, -1.0, 1.5], [1.0, -1.2, -0.8], [-0.5, -1.4, 3.0], [2.0, 0.5, 2.0]])
REACH = np.array([1.5, math.radians(30.0)])


@pytest.fixture(scope="module")
def room() -> Submap:
    return mapped(hall(), PLACES)


@pytest.fixture(scope="module")
def drift() -> Submap:
    """A stretch of a rough drift, of scans at their true poses."""
    submap = Submap(0.025, window_cells=1024)
    for pose, scan in zip(drive()[0][70:100], drive()[1][70:100], strict=True):
        submap.insert(planar_points(scan, LEVEL, np.zeros(3)), pose)
    return submap


@pytest.mark.parametrize("seed", range(6))
def test_a_scan_is_aligned_from_centimetres_off(room: Submap, seed: int) -> None:
    start = TRUE + np.random.default_rng(seed).uniform(-1.0, 1.0, 3) * np.array([0.05, 0.05, math.radians(1.0)])
    found = room.align(seen(hall(), TRUE, seed=seed), unsure(start))
    assert near(TRUE, found.pose, 0.004, 0.06)
    assert found.support > 0.85


def test_the_drift_is_no_harder(drift: Submap) -> None:
    points = planar_points(drive()[1][100], LEVEL, np.zeros(3))
    true = drive()[0][100]
    hits, start = Hits(points, len(points), layered=False), true + np.array([0.05, -0.04, math.radians(0.8)])
    assert off(true, drift.align(hits, unsure(start)).pose)[0] < 0.004
    far = se2.compose(true, np.array([-1.0, 0.2, math.radians(25.0)]))
    assert near(true, drift.locate(hits, unsure(far), REACH)[0].pose, 0.006, 0.1)


@pytest.mark.parametrize("turn_deg", [-25.0, 0.0, 25.0])
@pytest.mark.parametrize("shift", [(-1.0, 0.0), (0.0, 1.0), (0.7, -0.7)])
def test_a_scan_is_located_from_a_metre_and_25_degrees_off(
    room: Submap, shift: tuple[float, float], turn_deg: float
) -> None:
    predicted = se2.compose(TRUE, np.array([*shift, math.radians(turn_deg)]))
    found = room.locate(seen(hall(), TRUE), unsure(predicted), REACH)
    assert near(TRUE, found[0].pose, 0.004, 0.06)
    assert found[0].support > 0.85
    assert all(one.support < 0.6 for one in found[1:]), "the hall is like itself nowhere else"


def test_matches_are_in_order_and_at_places_of_their_own(room: Submap) -> None:
    found = room.locate(seen(hall(), TRUE), unsure(TRUE + 0.2), np.array([4.0, math.radians(90.0)]))
    support = [one.support for one in found]
    assert support == sorted(support, reverse=True)
    for k, one in enumerate(found):
        assert not any(near(other.pose, one.pose, 0.1, 2.0) for other in found[:k])


def test_the_best_of_all_candidates_is_the_first_that_is_located(room: Submap) -> None:
    asked = seen(hall(), TRUE), unsure(TRUE + 0.2), np.array([4.0, math.radians(90.0)])
    candidates, found = room.candidates(*asked), room.locate(*asked)
    assert found[0].support == max(one.support for one in candidates)
    for one in candidates:  # what was left out stands beside a better one, or fits nowhere
        beside = [other for other in found if near(other.pose, one.pose, 0.1, 2.0)]
        assert one.support == 0.0 or any(other.support >= one.support for other in beside)


def test_a_corridor_that_repeats_has_a_place_at_each_niche() -> None:
    """Three niches are within reach of a prediction half way between two, and a scan fits each as well."""
    submap = mapped(repeating(), walk(-14.0, 14.0, 29), SHORT)
    predicted = np.array([1.2, 0.1, math.radians(4.0)])
    found = submap.locate(seen(repeating(), np.zeros(3), SHORT), unsure(predicted), np.array([6.0, math.radians(15.0)]))
    for niche in (-1, 0, 1):
        there = np.array([niche * NICHE_M, 0.0, 0.0])
        fits = [one.support for one in found if near(there, one.pose, 0.01, 0.1)]
        assert len(fits) == 1, f"niche {niche}"
        assert fits[0] > 0.8


@pytest.mark.parametrize("reach_m", [0.5, 6.0])
def test_nothing_is_found_in_nothing(room: Submap, reach_m: float) -> None:
    hits, nothing, reach = seen(hall(), TRUE), np.zeros((0, 3)), np.array([reach_m, 0.5])
    assert Submap(CELL_M).locate(hits, unsure(TRUE), reach) == []
    assert Submap.of(nothing, CELL_M).locate(hits, unsure(TRUE), reach) == []
    assert room.locate(Hits(nothing, 0, layered=False), unsure(TRUE), reach) == []
    assert room.locate(hits, unsure(TRUE + np.array([100.0, 0.0, 0.0])), reach) == []
    assert Submap(CELL_M).align(hits, unsure(TRUE)).support == 0.0


def test_a_smooth_corridor_fixes_nothing_along() -> None:
    """Across and in heading it does; along the prior stands, and the match says that the scan adds nothing to it."""
    submap = mapped(smooth(), walk(-4.0, 4.0, 9), SHORT)
    prior = Prior(np.array([0.3, 0.03, math.radians(0.5)]), np.diag([1e4, 1.0, 1.0]))
    found = submap.align(seen(smooth(), np.zeros(3), SHORT), prior)
    along, across, heading = 1.0 / np.sqrt(marginal_information(found.information) + 1e-9)
    assert across < 0.002
    assert heading < math.radians(0.05)
    assert along > 10.0 * across
    assert abs(found.pose[1]) < 0.004
    assert abs(math.degrees(found.pose[2])) < 0.05
    assert abs(found.pose[0] - 0.3) < 0.03


@pytest.mark.parametrize("heading_rad", [0.4, 2.0])
def test_what_is_not_known_turns_with_the_corridor(heading_rad: float) -> None:
    """Information is in the map's axes: along an oblique corridor it is weak in the body's, whose x is the corridor's."""
    turn = np.array([3.0, -2.0, heading_rad])
    submap = Submap(CELL_M, window_cells=1024)
    for pose, points in zip(walk(-4.0, 4.0, 9), scans(smooth(), walk(-4.0, 4.0, 9), SHORT), strict=True):
        submap.insert(points, se2.compose(turn, pose))
    found = submap.align(seen(smooth(), np.zeros(3), SHORT), unsure(turn))
    information = marginal_information(body_information(found.information, found.pose[2]))
    assert information[1] > 100.0 * information[0]


HALL_HITS = [(pose, points) for pose, points in zip(PLACES, scans(hall(), PLACES), strict=True)]


@settings(max_examples=15, deadline=None)
@given(st.floats(-200.0, 200.0), st.floats(-200.0, 200.0), st.floats(-math.pi, math.pi))
def test_moving_the_frame_moves_the_answer(x: float, y: float, heading: float) -> None:
    """Cells and headings of the search lie elsewhere, so not to the digit."""
    T = np.array([x, y, heading])
    points = np.concatenate([se2.transform(se2.compose(T, pose), hits) for pose, hits in HALL_HITS])
    submap = Submap.of(points, CELL_M, window_cells=1024)
    hits, start = seen(hall(), TRUE), se2.compose(TRUE, np.array([0.04, -0.03, 0.015]))
    assert near(se2.compose(T, TRUE), submap.align(hits, unsure(se2.compose(T, start))).pose, 0.004, 0.06)
    away = se2.compose(T, se2.compose(TRUE, np.array([-0.6, 0.7, 0.4])))
    assert near(se2.compose(T, TRUE), submap.locate(hits, unsure(away), REACH)[0].pose, 0.004, 0.06)


def test_a_prior_that_is_sure_is_left_only_by_what_the_scan_says() -> None:
    """The estimate is the mean of prior and scan, weighted by their information."""
    submap, hits = mapped(hall(), PLACES), seen(hall(), TRUE)
    alone = submap.align(hits, unsure(TRUE))
    prior = Prior(TRUE + np.array([0.004, -0.003, 0.001]), alone.information)
    both = submap.align(hits, prior)
    assert both.pose == pytest.approx(0.5 * (alone.pose + prior.pose), abs=3e-4)


def test_a_search_compares_with_the_scans_that_are_remembered() -> None:
    """What left memory is still a wall for `align`; `locate` looks among the newest scans only."""
    submap = Submap(CELL_M, window_cells=1024, remembers=3)
    for pose, points in HALL_HITS:
        submap.insert(points, pose)
    assert submap.scans == 3
    far = scans(smooth(), walk(0.0, 1.0, 3), SHORT)
    for points in far:
        submap.insert(points, np.array([60.0, 0.0, 0.0]))
    hits = seen(hall(), TRUE)
    assert submap.locate(hits, unsure(TRUE), REACH) == []
    assert off(TRUE, submap.align(hits, unsure(TRUE + 0.01)).pose)[0] < 0.004


def test_points_stay_as_they_are() -> None:
    points: FloatArray = HALL_HITS[0][1].copy()
    submap = Submap.of(points, CELL_M)
    submap.locate(Hits(points, len(points), layered=False), unsure(np.zeros(3)), REACH)
    assert (points == HALL_HITS[0][1]).all()
