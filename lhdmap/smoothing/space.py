"""The pose graph in space: key scans in all six dimensions, solved by gtsam's Levenberg-Marquardt.

Factors, each with its own deviation:

- the odometry's step from key to key: in the level plane as measured, upwards the random walk of what a slope adds;
- roll and pitch by the inclinometer at each key (`AttitudeFactorPose3`: where up is);
- closures: in the plane what the match said (Cauchy), upwards what the floor rises between both places (Huber, on its own: a
  height that does not fit says nothing against the place).

Covariances of the level frame are turned into the axes of the body, which gtsam measures in: rotation before translation.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure
from lhdmap.smoothing.graph import chained
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.steps import step_covariance

HEIGHT_WALK = 0.004
"""Of the height, m per square root of a metre: of an inclinometer whose lag and bias are known."""
_SAME_M, _PER_METRE = 0.02, 0.03  # of a closure's height: floors are rough, and its slope is taken from both sides
_SHORTEST_M = 0.2
_SLOPE_KEYS = 3
_CAUCHY, _HUBER = 1.0, 2.0
_ATTITUDE_RAD = math.radians(0.05)
_LOOSE_RAD, _LOOSE_M = 3.0, 100.0
_FIXED = 1e-6
_YAW, _X, _Y, _Z = 2, 3, 4, 5  # of gtsam's tangent
_PLANAR = [_X, _Y, _YAW]


class InSpace(NamedTuple):
    """Planar poses of the keys (N, 3), by how much each is raised (N,), m; of the last: covariance (3, 3), height's deviation."""

    poses: FloatArray
    raised_m: FloatArray
    end_covariance: FloatArray
    end_height_std_m: float


def smoothed_in_space(
    keys: list[KeyScan], floor: FloatArray, closures: list[Closure], settings: SmoothingSettings
) -> InSpace:
    """Return the likeliest poses; `floor` (N, 3): height (m), roll and pitch (rad) at the keys, by the inclinometer."""
    import gtsam

    poses = [_matrix(key.pose, row) for key, row in zip(keys, floor, strict=True)]
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    first = gtsam.noiseModel.Isotropic.Sigma(6, _FIXED)
    graph.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(poses[0]), first))
    up, tilt = gtsam.Unit3(np.array([0.0, 0.0, 1.0])), gtsam.noiseModel.Isotropic.Sigma(2, _ATTITUDE_RAD)
    for index, T in enumerate(poses):
        values.insert(index, gtsam.Pose3(T))
        if index:
            graph.add(gtsam.AttitudeFactorPose3(index, up, tilt, gtsam.Unit3(T[2, :3])))
            step = gtsam.Pose3(se3.inverse(poses[index - 1]) @ T)
            noise = gtsam.noiseModel.Gaussian.Covariance(_of_step(keys[index - 1], keys[index], floor[index], settings))
            graph.add(gtsam.BetweenFactorPose3(index - 1, index, step, noise))
    for closure in closures:
        _add(graph, closure, keys, floor)
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    found = np.array([solved.atPose3(index).matrix() for index in range(len(keys))])
    end = _end_covariance(graph, solved, keys, floor[-1])
    heading = np.arctan2(found[:, 1, 0], found[:, 0, 0])
    planar = np.column_stack([found[:, 0, 3], found[:, 1, 3], heading])
    return InSpace(planar, found[:, 2, 3] - floor[:, 0], end[np.ix_(_PLANAR, _PLANAR)], math.sqrt(float(end[_Z, _Z])))


def _end_covariance(graph: Any, solved: Any, keys: list[KeyScan], floor: FloatArray) -> FloatArray:
    """Return the covariance (6, 6) of the last key in its level axes; the odometry's own where gtsam has no digits left."""
    import gtsam

    try:
        found = gtsam.Marginals(graph, solved).marginalCovariance(len(keys) - 1)
    except RuntimeError:
        found = np.diag(
            [2.0 * _ATTITUDE_RAD**2] * 2 + [0.0] * 3 + [HEIGHT_WALK**2 * max(keys[-1].travelled_m, _SHORTEST_M)]
        )
        found[np.ix_(_PLANAR, _PLANAR)] = chained(keys).covariance
        return found
    return _turned(found, floor, to_body=False)


def _add(graph: Any, closure: Closure, keys: list[KeyScan], floor: FloatArray) -> None:
    """Add a closure: what the match said in the plane, and how much the floor rises between both places."""
    import gtsam

    x, y, turn = closure.pose_earlier_current.tolist()
    here, there = floor[closure.earlier], floor[closure.current]
    level = se3.from_rpy(0.0, 0.0, turn, (x, y, _rise_m(keys, floor[:, 0], closure)))
    T = se3.inverse(se3.from_rpy(here[1], here[2], 0.0)) @ level @ se3.from_rpy(there[1], there[2], 0.0)
    height_m = _SAME_M + _PER_METRE * math.hypot(x, y)
    plane = np.diag([_LOOSE_RAD**2] * 3 + [_LOOSE_M**2] * 3)
    plane[np.ix_(_PLANAR, _PLANAR)] = closure.covariance
    upwards = np.diag([_LOOSE_RAD**2] * 3 + [_LOOSE_M**2] * 2 + [height_m**2])
    kernels = gtsam.noiseModel.mEstimator
    for covariance, kernel in ((plane, kernels.Cauchy.Create(_CAUCHY)), (upwards, kernels.Huber.Create(_HUBER))):
        gaussian = gtsam.noiseModel.Gaussian.Covariance(_turned(covariance, there, to_body=True))
        robust = gtsam.noiseModel.Robust.Create(kernel, gaussian)
        graph.add(gtsam.BetweenFactorPose3(closure.earlier, closure.current, gtsam.Pose3(T), robust))


def _of_step(before: KeyScan, after: KeyScan, floor: FloatArray, settings: SmoothingSettings) -> FloatArray:
    """Return the covariance (6, 6) of a step, in the body's axes at its end."""
    way_m = max(after.travelled_m - before.travelled_m, _SHORTEST_M)
    covariance = np.diag([2.0 * _ATTITUDE_RAD**2] * 2 + [0.0] * 3 + [HEIGHT_WALK**2 * way_m])
    covariance[np.ix_(_PLANAR, _PLANAR)] = step_covariance(before, after, settings)
    return _turned(covariance, floor, to_body=True)


def _turned(covariance: FloatArray, floor: FloatArray, *, to_body: bool) -> FloatArray:
    """Return a covariance (6, 6) turned from the level frame into the body's, or back."""
    R = se3.from_rpy(floor[1], floor[2], 0.0)[:3, :3]
    R = R.T if to_body else R
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = R
    out: FloatArray = both @ covariance @ both.T
    return out


def _matrix(planar: FloatArray, floor: FloatArray) -> FloatArray:
    return se3.from_rpy(
        float(floor[1]), float(floor[2]), float(planar[2]), (float(planar[0]), float(planar[1]), float(floor[0]))
    )


def _rise_m(keys: list[KeyScan], heights_m: FloatArray, closure: Closure) -> float:
    """Return how much the floor rises from the earlier key to where the current one is, by the slope around the earlier key."""
    low, high = max(closure.earlier - _SLOPE_KEYS, 0), min(closure.earlier + _SLOPE_KEYS, len(keys) - 1)
    way = keys[high].pose[:2] - keys[low].pose[:2]
    heading = keys[closure.earlier].pose[2]
    run = math.cos(heading) * way[0] + math.sin(heading) * way[1]
    if abs(run) < 1.0:
        return 0.0
    slope = float(heights_m[high] - heights_m[low]) / run
    return slope * float(closure.pose_earlier_current[0])
