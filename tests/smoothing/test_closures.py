"""Loop closures and the pose graph on places and graphs that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure, _confirmed, find_closures
from lhdmap.smoothing.graph import chained, smoothed
from lhdmap.smoothing.keys import KeyScans
from lhdmap.smoothing.reach import Drift
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Smoother
from lhdmap.smoothing.steps import step_covariances

from tests.smoothing.places import SIGMA_M, SIGMA_RAD, WALK, drifted, keys_of, lap, square, straight

SETTINGS = SmoothingSettings()
NO_POINTS = np.zeros((1, 3), dtype=np.float32)


@pytest.fixture(scope="module")
def twice_round() -> tuple[FloatArray, list[KeyScan]]:
    """A lap of 64 m and 16 m more of the next, by an odometry with 0.5 % scale error and 1.6° of turn a lap."""
    true = lap(80)
    return true, keys_of(square(), true, drifted(true, 1.005, 0.025))


def test_a_second_lap_closes_the_loop(twice_round: tuple[FloatArray, list[KeyScan]]) -> None:
    true, keys = twice_round
    closures = find_closures(keys, SETTINGS)
    assert len(closures) >= 8
    for closure in closures:
        error = se2.between(se2.between(true[closure.earlier], true[closure.current]), closure.pose_earlier_current)
        assert np.hypot(error[0], error[1]) < 0.05
        assert abs(math.degrees(error[2])) < 0.5


def test_the_graph_shrinks_the_error(twice_round: tuple[FloatArray, list[KeyScan]]) -> None:
    true, keys = twice_round
    before = np.array([key.pose for key in keys])
    after = smoothed(keys, find_closures(keys, SETTINGS), SETTINGS).poses
    assert after[0] == pytest.approx(true[0], abs=1e-4)
    assert (
        np.hypot(*(after[64:, :2] - true[64:, :2]).T).mean()
        < 0.3 * np.hypot(*(before[64:, :2] - true[64:, :2]).T).mean()
    )
    assert np.hypot(*(after[:, :2] - true[:, :2]).T).mean() < np.hypot(*(before[:, :2] - true[:, :2]).T).mean()


@pytest.mark.parametrize(("deeper_m", "closes"), [(1.5, True), (12.0, False)])
def test_a_level_below_is_another_place(
    twice_round: tuple[FloatArray, list[KeyScan]], deeper_m: float, closes: bool
) -> None:
    """A mine's levels are alike in plan; heights that differ by no more than an inclinometer drifts are one level."""
    _, keys = twice_round
    lower = [
        key._replace(points=key.points - np.array([0.0, 0.0, deeper_m if k >= 60 else 0.0], np.float32))
        for k, key in enumerate(keys)
    ]
    assert bool(find_closures(lower, SETTINGS)) == closes


def test_a_straight_smooth_drift_is_never_closed() -> None:
    world, true = straight(40, 0.0005)
    assert find_closures(keys_of(world, true, drifted(true, 1.01, 0.0)), SETTINGS) == []


def test_there_and_back_in_a_smooth_drift_fixes_nothing_along() -> None:
    """Out of sight of its ends it looks the same everywhere: to close it would be to guess."""
    world, true = straight(40, 0.0005)
    way = np.concatenate([true[15:35], true[34:14:-1]])
    assert find_closures(keys_of(world, way, way, reach_m=8.0), SETTINGS) == []


def plain_keys(count: int) -> list[KeyScan]:
    poses = [np.array([float(k), 0.0, 0.0]) for k in range(count)]
    return [KeyScan(k, pose, float(k), NO_POINTS, WALK) for k, pose in enumerate(poses)]


def closure(earlier: int, current: int, shift_m: float = 0.0) -> Closure:
    pose = np.array([float(current - earlier) + shift_m, 0.0, 0.0])
    return Closure(earlier, current, pose, np.diag([1e-4, 1e-4, 1e-6]))


def test_a_closure_that_its_neighbours_contradict_is_dropped() -> None:
    right = [closure(2, 42), closure(3, 43), closure(5, 45), closure(6, 46)]
    wrong = closure(4, 44, shift_m=3.0)
    kept = _confirmed([*right[:2], wrong, *right[2:]], plain_keys(50), SETTINGS)
    assert kept == right


def test_a_lone_closure_is_dropped() -> None:
    assert _confirmed([closure(2, 42)], plain_keys(50), SETTINGS) == []


def test_the_graph_of_a_tiny_loop_has_the_least_squares_solution() -> None:
    """Three steps of 1 m along a line and a closure that says 3.3: with equal weights the rest is shared out evenly."""
    keys, sigma = plain_keys(4), math.hypot(SIGMA_M, SETTINGS.along_sigma)
    variance = 1e4 * np.diag([sigma**2, sigma**2, 1.0])  # so weak that the robust kernel stays quadratic
    shift = 0.001
    found = smoothed(keys, [Closure(0, 3, np.array([3.0 + shift, 0.0, 0.0]), variance)], SETTINGS).poses
    weight = (1 / (1e4 * sigma**2)) / (1 / (1e4 * sigma**2) + 1 / (3 * sigma**2))
    assert found[3, 0] - 3.0 == pytest.approx(shift * weight, rel=0.01)
    assert np.diff(found[:, 0]) == pytest.approx(np.full(3, 1.0 + shift * weight / 3), abs=1e-9)


def test_one_gross_closure_does_not_bend_the_graph() -> None:
    right = [closure(k, k + 30) for k in range(20)]
    found = smoothed(plain_keys(50), [*right, closure(10, 41, shift_m=15.0)], SETTINGS).poses
    assert np.abs(found[:, 0] - np.arange(50.0)).max() < 0.1


def test_without_closures_the_odometry_stands() -> None:
    smoother = Smoother(SETTINGS)
    for k in range(30):
        smoother.keys.update(k, np.array([float(k), 0.0, 0.0]), np.ones((20, 3)), WALK)
    assert smoother.correction() is None


def test_keys_are_a_metre_apart_and_say_how_far_their_steps_may_be_off() -> None:
    """A random walk of a heading swings the way that follows: its variance grows with the cube of the length."""
    keys = KeyScans(SETTINGS)
    for k in range(1006):
        keys.update(k, np.array([0.1 * k, 0.0, 0.0]), np.ones((5, 3)), WALK, unseen=30 <= k < 70)
    places = np.array([key.pose[0] for key in keys.keys])
    assert np.diff(places) == pytest.approx(1.0, abs=0.11)
    assert keys.keys[-1].travelled_m == pytest.approx(places[-1])
    assert keys.unseen_m == pytest.approx(4.0)
    end, steps, way_m = chained(keys.keys), 10.0 * places[-1], places[-1]
    assert end.walk[0, 0] == pytest.approx(steps * SIGMA_M**2)
    assert end.walk[2, 2] == pytest.approx(steps * SIGMA_RAD**2)
    assert end.walk[1, 1] == pytest.approx(steps * (SIGMA_M**2 + (SIGMA_RAD * way_m) ** 2 / 3.0), rel=0.01)
    assert keys.rest.walk[0, 0] == pytest.approx(round(10.0 * (keys.travelled_m - way_m)) * SIGMA_M**2)


def test_a_step_that_is_hardly_known_leaves_the_graph_solvable() -> None:
    """The first metre of a real log was off by 5 m and 3 rad (one sigma): gtsam found the system indeterminate."""
    loose = WALK._replace(walk=np.diag([24.0, 6.6, 8.9]))
    keys = [key._replace(error=loose) if k in (1, 30) else key for k, key in enumerate(plain_keys(60))]
    found = smoothed(keys, [closure(k, k + 30) for k in range(2, 28)], SETTINGS)
    assert np.isfinite(found.poses).all()
    assert np.isfinite(found.end_covariance).all()
    assert found.end_covariance[0, 0] < 25.0 + chained(keys).covariance[0, 0]


def test_the_radius_is_that_of_the_chained_steps() -> None:
    """Sums along the drive against the covariances put together step by step, on a way with bends."""
    true = lap(70)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))])
    keys = [KeyScan(k, pose, float(way[k]), NO_POINTS, WALK) for k, pose in enumerate(true)]
    drift = Drift(keys, SETTINGS)
    steps = step_covariances(keys, SETTINGS)
    for earlier, current in ((0, 69), (10, 50), (40, 41)):
        covariance = steps[earlier]
        for row in range(earlier + 1, current):
            step = se2.between(keys[row].pose, keys[row + 1].pose)
            covariance = se2.composed_covariance(covariance, step, steps[row])
        expected = 2.5 * math.sqrt(float(np.trace(covariance[:2, :2])))
        assert drift.radius_m(np.array([earlier]), current)[0] == pytest.approx(expected, rel=1e-6)
