"""The pose graph: odometry between key scans and closures, solved by gtsam's Levenberg-Marquardt with robust closures."""

from __future__ import annotations

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure

_CAUCHY = 1.0


def smoothed(keys: list[KeyScan], closures: list[Closure]) -> FloatArray:
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
        noise = gtsam.noiseModel.Gaussian.Covariance(keys[index + 1].step_covariance)
        graph.add(gtsam.BetweenFactorPose2(index, index + 1, gtsam.Pose2(*step), noise))
    for closure in closures:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(closure.covariance)
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(_CAUCHY), gaussian)
        pose = gtsam.Pose2(*closure.T_earlier_current)
        graph.add(gtsam.BetweenFactorPose2(closure.earlier, closure.current, pose, robust))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    found = [solved.atPose2(index) for index in range(len(keys))]
    return np.array([[pose.x(), pose.y(), pose.theta()] for pose in found])
