"""The pose graph: odometry between key scans and closures, solved by gtsam's Levenberg-Marquardt with robust closures."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.step_error import NO_ERROR, StepError
from lhdmap.smoothing.closures import Closure
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.steps import step_covariance

_CAUCHY = 1.0


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
        noise = gtsam.noiseModel.Gaussian.Covariance(step_covariance(keys[index], keys[index + 1], settings))
        graph.add(gtsam.BetweenFactorPose2(index, index + 1, gtsam.Pose2(*step), noise))
    for closure in closures:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(closure.covariance)
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(_CAUCHY), gaussian)
        pose = gtsam.Pose2(*closure.pose_earlier_current)
        graph.add(gtsam.BetweenFactorPose2(closure.earlier, closure.current, pose, robust))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    found = [solved.atPose2(index) for index in range(len(keys))]
    try:
        end = gtsam.Marginals(graph, solved).marginalCovariance(len(keys) - 1)
    except RuntimeError:  # numbers too far apart: what the odometry alone would say is never too sure
        end = chained(keys).covariance
    return Smoothed(np.array([[pose.x(), pose.y(), pose.theta()] for pose in found]), end)


def chained(keys: list[KeyScan]) -> StepError:
    """Return the error of the way from the first key to the last, in the last one's axes, by the odometry alone."""
    total = NO_ERROR
    for before, key in pairwise(keys):
        total = total.then(se2.between(before.pose, key.pose), key.error)
    return total
