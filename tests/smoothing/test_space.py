"""The pose graph in space against drives whose errors are drawn from what it is told of them."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.step_error import StepError
from lhdmap.smoothing.closures import Closure
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.space import HEIGHT_WALK, InSpace, smoothed_in_space
from lhdmap.smoothing.steps import step_covariance

LAP, COUNT = 80, 140
NO_POINTS = np.zeros((1, 3), np.float32)
STD, SEEN = np.array([0.02, 0.01, math.radians(0.1)]), np.array([0.02, 0.02, math.radians(0.1)])
ERROR = StepError(np.diag(STD**2), np.zeros(3), np.zeros((3, 3)))


def _true() -> tuple[FloatArray, FloatArray]:
    """Return poses (N, 3) and heights (N,) of almost two laps of a ring that rises and falls."""
    angle = 2.0 * np.pi * np.arange(COUNT) / LAP
    radius = LAP / (2.0 * np.pi)
    poses = np.column_stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle])
    return poses, 0.6 * np.sin(angle)


def _solved(seed: int) -> tuple[InSpace, FloatArray, FloatArray, FloatArray]:
    """Drive with noise and close the loop; return what was solved, true poses, true heights, and the heights told."""
    rng = np.random.default_rng(seed)
    true, heights = _true()
    pose, told, keys, rises = np.zeros(3), heights.copy(), [], 0.0
    for k in range(COUNT):
        if k:
            before = KeyScan(k - 1, pose, float(k - 1), NO_POINTS, ERROR)
            step = se2.between(true[k - 1], true[k])
            covariance = step_covariance(
                before, KeyScan(k, se2.compose(pose, step), float(k), NO_POINTS, ERROR), SETTINGS
            )
            pose = se2.compose(pose, se2.compose(step, rng.multivariate_normal(np.zeros(3), covariance)))
            rises += HEIGHT_WALK * rng.standard_normal()
        told[k] += rises
        keys.append(KeyScan(k, pose, float(k), NO_POINTS, ERROR))
    closures = [
        Closure(
            k,
            k + LAP,
            se2.compose(se2.between(true[k], true[k + LAP]), SEEN * rng.standard_normal(3)),
            np.diag(SEEN**2),
        )
        for k in range(5, COUNT - LAP, 5)
    ]
    pitch = -np.arctan(np.gradient(told))
    return (
        smoothed_in_space(keys, np.column_stack([told, np.zeros(COUNT), pitch]), closures, SETTINGS),
        true,
        heights,
        told,
    )


SETTINGS = SmoothingSettings()


def test_covariances_of_the_end_are_true() -> None:
    """Normalised squared errors of the last key, in the plane and upwards: 3 and 1 on the mean where covariances are true."""
    plane, height = [], []
    for seed in range(20):
        found, true, heights, told = _solved(seed)
        error = se2.between(true[-1], found.poses[-1])
        error[2] = float(se2.wrap(error[2]))
        plane.append(float(error @ np.linalg.solve(found.end_covariance, error)))
        height.append(((told + found.raised_m - heights)[-1] / found.end_height_std_m) ** 2)
    assert 1.5 < np.mean(plane) < 6.0
    assert 0.2 < np.mean(height) < 2.0


def test_plane_and_height_are_better_than_the_odometry_is() -> None:
    before, after = [], []
    for seed in range(5):
        found, true, heights, told = _solved(seed)
        after.append([np.hypot(*(found.poses - true)[-1, :2]), abs((told + found.raised_m - heights)[-1])])
        before.append([2.0 * LAP * 0.5 * STD[2] * math.sqrt(LAP), HEIGHT_WALK * math.sqrt(COUNT)])
    assert np.all(np.mean(after, axis=0) < 0.5 * np.mean(before, axis=0))
