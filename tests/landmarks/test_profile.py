"""The profile of the walls, and where it finds itself again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from lhdmap.landmarks.build import node_surface
from lhdmap.landmarks.distinct import APART_M, gaps, not_distinctive
from lhdmap.landmarks.profile import WallProfile, line_pose, profile_of
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray

from tests.landmarks.conftest import Taught
from tests.landmarks.worlds import HALF_WIDTH_M, ROUGH, SMOOTH, drive, tunnel

SETTINGS = LandmarkSettings()


def made(left: FloatArray, right: FloatArray) -> WallProfile:
    """Return a straight profile with these walls."""
    n = len(left)
    at = (SETTINGS.profile_m * np.arange(n)).astype(np.float32)
    line = np.column_stack([at, np.zeros(n)]).astype(np.float32)
    var = np.full(n, 0.004**2, np.float32)
    walls = (left.astype(np.float32), right.astype(np.float32))
    return WallProfile(at, line, np.zeros(n, np.float32), *walls, var, var, np.full(n, np.inf, np.float32))


def wall(seed: int, n: int, rms_m: float) -> FloatArray:
    rng = np.random.default_rng(seed)
    rough = np.convolve(rng.standard_normal(n + 8), np.hanning(9), "valid")
    return HALF_WIDTH_M + rms_m * rough[:n] / rough.std()


def test_straight_walls_are_where_they_are() -> None:
    """Walls at 1.5 m and 2.5 m of a way that is not in the middle: the mid line is, and sees both at 2 m."""
    x = np.arange(-5.0, 45.0, 0.03)
    cells = np.concatenate([np.column_stack([x, np.full_like(x, 1.5)]), np.column_stack([x, np.full_like(x, -2.5)])])
    way = np.column_stack([np.arange(0.0, 41.0), np.zeros(41)])
    profile = profile_of(cells, np.ones(len(cells)), way, np.arange(100.0, 141.0), SETTINGS)
    assert profile.left_m == pytest.approx(2.0, abs=0.01)
    assert profile.right_m == pytest.approx(2.0, abs=0.01)
    assert profile.line_m[:, 1] == pytest.approx(-0.5, abs=0.01)
    assert profile.at_m[[0, -1]] == pytest.approx([100.0, 140.0], abs=0.2)
    assert profile.step_m == pytest.approx(SETTINGS.profile_m, rel=0.01)
    assert line_pose(profile, 120.0) == pytest.approx([20.0, -0.5, 0.0], abs=0.01)


def test_niches_are_where_they_are() -> None:
    world = tunnel(8, SMOOTH, 40.0, niches=True)
    profile = node_surface(drive(world, 1), world.frame(), SETTINGS, tunnel=True).profile
    assert profile is not None
    deep = profile.left_m + profile.right_m > 2.0 * HALF_WIDTH_M + 1.2
    # the true walls: first the left one, then the right one, a segment each step of the line
    left, right = np.split(world.segments_m, 2)
    x = left[:, 0] - world.frame()[0]
    true = left[:, 1] - right[:, 1] > 2.0 * HALF_WIDTH_M + 1.2
    expected = [edge for edge in x[np.flatnonzero(np.diff(true.astype(int)))] if 0.0 < edge < 40.0]
    found = profile.at_m[np.flatnonzero(np.diff(deep.astype(int)))]
    assert len(expected) == 10
    assert found == pytest.approx(np.array(expected), abs=0.45)


def test_it_does_not_matter_where_in_the_tunnel_one_drives(bent: Taught) -> None:
    other = node_surface(drive(bent.world, 9, offset_m=-0.4), bent.world.frame(), SETTINGS, tunnel=True).profile
    own = bent.landmarks.surfaces["t"].profile
    assert own is not None
    assert other is not None
    both = np.interp(own.at_m, other.at_m, other.left_m)
    inside = (own.at_m > 5.0) & (own.at_m < 65.0)
    difference = np.abs(both - own.left_m)[inside]
    assert np.nanmedian(difference) < 0.02


def plainly(profile: WallProfile, window: int) -> FloatArray:
    """Return the gap of each window by trying each place, both ways; the two walls alone."""
    n = len(profile.at_m)
    walls = np.stack([profile.left_m, profile.right_m]).astype(float)
    variances = (
        np.stack([profile.left_var, profile.right_var])
        + (np.abs(np.gradient(walls, SETTINGS.profile_m, axis=1)) * 0.05) ** 2
    )
    variances = variances + 0.5 * 0.005**2
    out = np.full(n, np.inf)
    for a in range(n - window + 1):
        for b in range(n - window + 1):
            if abs(a - b) < APART_M / SETTINGS.profile_m - 1e-9:
                continue
            for turned in (False, True):
                here = slice(a, a + window)
                there = walls[::-1, b : b + window][:, ::-1] if turned else walls[:, b : b + window]
                theirs = variances[::-1, b : b + window][:, ::-1] if turned else variances[:, b : b + window]
                x = (walls[:, here] - there) ** 2 / (variances[:, here] + theirs)
                out[a + window // 2] = min(out[a + window // 2], ((np.minimum(x, 9.0) - 1.0) / 6.0).sum())
    return out


def test_the_gap_is_that_of_the_best_other_place() -> None:
    profile = made(wall(1, 70, 0.02), wall(2, 70, 0.02))
    short = dataclasses.replace(SETTINGS, distinct_m=2.0)
    expected, found = plainly(profile, 20), gaps(profile, short)
    middle = np.isfinite(expected)
    # a mid line that does not turn is the same everywhere: its own channel takes off its share
    straight = 20 * short.profile_m / short.smooth_m / 6.0
    assert np.median(np.abs(found[middle] - expected[middle])) < straight + 1e-3


def test_a_stretch_that_is_there_twice_is_named() -> None:
    n = 1000
    left, right = wall(1, n, 0.1), wall(2, n, 0.1)
    left[700:900], right[700:900] = left[100:300], right[100:300]
    profile = made(left, right)
    found = not_distinctive(profile.at_m, gaps(profile, SETTINGS), SETTINGS.distinct_gap)
    assert len(found) == 2
    assert found[0] == pytest.approx((17.5, 22.5), abs=5.0)  # a window that has a little of its own is not enough
    assert found[1] == pytest.approx((77.5, 82.5), abs=5.0)


def test_a_stretch_that_is_there_the_other_way_round_is_named() -> None:
    n = 1000
    left, right = wall(1, n, 0.1), wall(2, n, 0.1)
    left[700:900], right[700:900] = right[100:300][::-1].copy(), left[100:300][::-1].copy()
    profile = made(left, right)
    found = not_distinctive(profile.at_m, gaps(profile, SETTINGS), SETTINGS.distinct_gap)
    assert [round(0.5 * (a + b)) for a, b in found] == [20, 80]


def test_smooth_walls_are_named_and_rough_ones_are_not(smooth: Taught, rough: Taught, bent: Taught) -> None:
    assert rough.landmarks.not_distinctive_m("t", SETTINGS) == []
    assert bent.landmarks.not_distinctive_m("t", SETTINGS) == []
    (stretch,) = smooth.landmarks.not_distinctive_m("t", SETTINGS)
    assert stretch == pytest.approx((0.0, 70.0), abs=0.3)


def test_the_papers_way_names_what_is_beyond_the_keys(rough: Taught) -> None:
    paper = dataclasses.replace(SETTINGS, method="paper")
    made = rough.landmarks
    found = made.not_distinctive_m("t", paper)
    for k in np.flatnonzero(made.key):
        assert not any(start < made.at_m[k] < stop for start, stop in found)
    covered = sum(2.0 * (made.radius[k] + 0.5) * 2.0 for k in np.flatnonzero(made.key))
    assert sum(stop - start for start, stop in found) >= 70.0 - covered - 1e-6


def test_walls_that_are_not_seen_tell_nothing() -> None:
    profile = made(np.full(400, np.nan), np.full(400, np.nan))
    assert (gaps(profile, SETTINGS) <= 0.0).all()


def test_a_tunnel_without_another_place_is_distinctive() -> None:
    profile = made(wall(1, 120, 0.1), wall(2, 120, 0.1))
    assert np.isinf(gaps(profile, SETTINGS)).all()


def test_rough_walls_of_another_seed_are_not_named_either() -> None:
    world = tunnel(11, ROUGH, 60.0, bends=True)
    surface = node_surface(drive(world, 2), world.frame(), SETTINGS, tunnel=True)
    assert surface.profile is not None
    assert surface.profile.gap.min() > SETTINGS.distinct_gap
