"""The pose graph: odometry between key scans and closures, solved by gtsam's Levenberg-Marquardt with robust closures."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.step_error import NO_ERROR, StepError
from lhdmap.smoothing.closures import Closure
from lhdmap.smoothing.settings import SmoothingSettings

_CAUCHY = 1.0
_SHORTEST_M, _PER_TURN = 0.1, 0.002
# Deviations of a step beyond which it ties nothing: a heading of more turns round, and marginals would have no digits left.
_LOOSEST = np.array([3.0, 3.0, 0.5])


class Smoothed(NamedTuple):
    """Poses of the keys, shape (N, 3), in the frame of the first, and the covariance (3, 3) of the last in its own axes."""

    poses: FloatArray
    end_covariance: FloatArray


def smoothed(keys: list[KeyScan], closures: list[Closure], settings: SmoothingSettings) -> Smoothed:
    """Return the likeliest poses: steps and closures weigh as they were measured.

    Without closures these are the odometry's own.
    """
    import gtsam

    poses = np.array([key.pose for key in keys])
    if not closures:
        return Smoothed(poses, chained(keys).covariance)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    fixed = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), fixed))
    for index, pose in enumerate(poses):
        values.insert(index, gtsam.Pose2(*pose))
    for index in range(len(keys) - 1):
        step = se2.between(poses[index], poses[index + 1])
        noise = gtsam.noiseModel.Gaussian.Covariance(_step_covariance(keys[index], keys[index + 1], settings))
        graph.add(gtsam.BetweenFactorPose2(index, index + 1, gtsam.Pose2(*step), noise))
    for closure in closures:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(closure.covariance)
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(_CAUCHY), gaussian)
        pose = gtsam.Pose2(*closure.T_earlier_current)
        graph.add(gtsam.BetweenFactorPose2(closure.earlier, closure.current, pose, robust))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    found = [solved.atPose2(index) for index in range(len(keys))]
    try:
        end = gtsam.Marginals(graph, solved).marginalCovariance(len(keys) - 1)
    except RuntimeError:  # numbers too far apart: what the odometry alone would say is never too sure
        end = chained(keys).covariance
    return Smoothed(np.array([[pose.x(), pose.y(), pose.theta()] for pose in found]), end)


def step_covariances(keys: list[KeyScan], settings: SmoothingSettings) -> list[FloatArray]:
    """Return the covariances (3, 3) of the steps from key to key, each in the axes of its end."""
    return [_step_covariance(before, after, settings) for before, after in pairwise(keys)]


def _step_covariance(before: KeyScan, after: KeyScan, settings: SmoothingSettings) -> FloatArray:
    """Return the covariance (3, 3) of a step: what was measured, and what no drive is better than."""
    travel_m = max(after.travelled_m - before.travelled_m, _SHORTEST_M)
    turn = abs(float(se2.wrap(after.pose[2] - before.pose[2])))
    position = settings.along_sigma * math.sqrt(travel_m)
    heading = math.radians(settings.heading_sigma_deg) * math.sqrt(travel_m) + _PER_TURN * turn
    covariance = after.error.covariance + np.diag([position**2, position**2, heading**2])
    share = np.minimum(1.0, _LOOSEST / np.sqrt(np.diag(covariance)))
    bounded: FloatArray = covariance * np.outer(share, share)
    return bounded


def chained(keys: list[KeyScan]) -> StepError:
    """Return the error of the way from the first key to the last, in the last one's axes, by the odometry alone."""
    total = NO_ERROR
    for before, key in pairwise(keys):
        total = total.then(se2.between(before.pose, key.pose), key.error)
    return total
