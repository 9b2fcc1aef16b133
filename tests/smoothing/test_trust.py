"""How far a map may be off at its end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.scan_matching.step_error import NO_ERROR
from lhdmap.smoothing.closures import find_closures
from lhdmap.smoothing.graph import smoothed
from lhdmap.smoothing.keys import KeyScans
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.trust import expected_error, radius_m

from tests.smoothing.places import SIGMA_M, SIGMA_RAD, WALK, keys_of, lap, square

HITS = np.ones((5, 3))


def driven(metres: int, *, unseen: bool = False) -> KeyScans:
    keys = KeyScans(SmoothingSettings())
    for k in range(metres + 1):
        keys.update(k, np.array([float(k), 0.0, 0.0]), HITS, WALK, unseen=unseen)
    return keys


@pytest.mark.parametrize("sigmas", [(1.0, 1.0), (1.0, 0.3), (1.0, 0.0), (0.2, 5.0)])
def test_95_of_100_errors_are_within_the_radius(sigmas: tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    c, s = math.cos(0.7), math.sin(0.7)
    R = np.array([[c, -s], [s, c]])
    points = rng.standard_normal((40_000, 2)) * sigmas @ R.T
    inside = np.hypot(*points.T) < radius_m(R @ np.diag(np.square(sigmas)) @ R.T)
    assert inside.mean() == pytest.approx(0.95, abs=0.01)


def test_the_end_of_a_straight_way() -> None:
    """The heading's random walk swings the end: its variance grows with the cube of the way."""
    found = expected_error(driven(100), 0.05)
    assert found is not None
    across = 100 * SIGMA_M**2 + SIGMA_RAD**2 * sum(k * k for k in range(100))
    assert found.end_m == pytest.approx(radius_m(np.diag([100 * SIGMA_M**2, across])), rel=1e-6)
    assert found.end_pct == pytest.approx(found.end_m)
    assert found.heading_deg == pytest.approx(math.degrees(1.96 * SIGMA_RAD * 10.0))
    assert found.height_m == pytest.approx(1.96 * 0.05)
    assert not found.lower_bound


def test_what_neither_walls_nor_wheels_told_makes_it_a_lower_bound() -> None:
    found = expected_error(driven(30, unseen=True), None)
    assert found is not None
    assert found.lower_bound
    assert found.unseen_m == pytest.approx(30.0)
    assert found.height_m is None


def test_nothing_is_said_without_key_scans() -> None:
    assert expected_error(KeyScans(SmoothingSettings()), None) is None


@pytest.mark.parametrize("seed", [1, 2])
def test_closed_loops_shrink_it_and_hold_the_truth(seed: int) -> None:
    """An odometry that wanders as its keys say, a lap and a quarter of the next."""
    true, rng = lap(80), np.random.default_rng(seed)
    estimate = [true[0]]
    for step in map(se2.between, true, true[1:]):
        off = np.array([SIGMA_M, SIGMA_M, SIGMA_RAD]) * rng.standard_normal(3)
        estimate.append(se2.compose(se2.compose(estimate[-1], step), off))
    keys = KeyScans(SmoothingSettings())
    keys.keys = keys_of(square(), true, np.array(estimate))
    keys.travelled_m = keys.keys[-1].travelled_m
    poses, end = smoothed(keys.keys, find_closures(keys.keys, SmoothingSettings()), SmoothingSettings())
    open_, closed = expected_error(keys, None), expected_error(keys, None, end)
    assert open_ is not None
    assert closed is not None
    assert closed.end_m < 0.5 * open_.end_m
    assert closed.heading_deg < 0.5 * open_.heading_deg
    assert np.hypot(*(poses[-1] - true[-1])[:2]) < 1.5 * closed.end_m


def test_a_pulled_way_is_not_mended_by_a_loop() -> None:
    """A map that is too large closes all the same."""
    keys = KeyScans(SmoothingSettings())
    for k in range(101):
        keys.update(k, np.array([float(k), 0.0, 0.0]), HITS, NO_ERROR._replace(pull=np.array([0.01, 0.0, 0.0])))
    found = expected_error(keys, None, 1e-8 * np.eye(3))
    assert found is not None
    assert found.end_m == pytest.approx(1.96, rel=0.01)
