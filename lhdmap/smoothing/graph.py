"""The pose graph: odometry between key scans and closures, solved by gtsam's Levenberg-Marquardt with robust closures."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.closures import Closure
from lhdmap.smoothing.keys import KeyScan
from lhdmap.smoothing.settings import SmoothingSettings

_CAUCHY = 1.0


def smoothed(keys: list[KeyScan], closures: list[Closure], settings: SmoothingSettings) -> FloatArray:
    """Return the poses of the keys, shape (N, 3), in the frame of the first: maximum a posteriori.

    Without closures these are the odometry's own.
    """
    import gtsam

    poses = np.array([key.pose for key in keys])
    if not closures:
        return poses
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    fixed = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), fixed))
    for index, pose in enumerate(poses):
        values.insert(index, gtsam.Pose2(*pose))
    for index in range(len(keys) - 1):
        step = se2.between(poses[index], poses[index + 1])
        noise = gtsam.noiseModel.Diagonal.Sigmas(_step_sigmas(keys[index], keys[index + 1], settings))
        graph.add(gtsam.BetweenFactorPose2(index, index + 1, gtsam.Pose2(*step), noise))
    for closure in closures:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(closure.covariance)
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(_CAUCHY), gaussian)
        pose = gtsam.Pose2(*closure.T_earlier_current)
        graph.add(gtsam.BetweenFactorPose2(closure.earlier, closure.current, pose, robust))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    found = [solved.atPose2(index) for index in range(len(keys))]
    return np.array([[pose.x(), pose.y(), pose.theta()] for pose in found])


def _step_sigmas(before: KeyScan, after: KeyScan, settings: SmoothingSettings) -> FloatArray:
    """Return the standard deviations (3,) of a step between keys: a random walk with the travel, wider where weak."""
    travel_m = max(after.travelled_m - before.travelled_m, 0.1)
    position = (settings.weak_sigma if after.weak else settings.along_sigma) * math.sqrt(travel_m)
    turn = abs(float(se2.wrap(after.pose[2] - before.pose[2])))
    heading = math.radians(settings.heading_sigma_deg) * math.sqrt(travel_m) + 0.002 * turn
    return np.array([position, position, heading])
