"""Which closures to believe: graduated non-convexity with truncated least squares, checked by a second kernel.

The odometry is known to be right within its covariance; a closure is right or it is of another place altogether. GNC (Yang et al.,
2020, in gtsam) finds the largest set of closures that agrees with the odometry, from a cost that is first smooth and then cut off.
Cauchy's kernel followed by dynamic covariance scaling is another way to the same end: closures on which the two disagree are
doubtful, and where both paths differ by more than a metre only those count on which they agree. At last each refused one is tried
once more: where the path can follow it at no more cost than a right closure has, it was right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray

Flags = npt.NDArray[np.bool_]

_PROBABILITY = 0.999  # that a right closure is within the cut-off
_CHI2_999, _CHI2_9999 = 16.266, 21.108  # of three numbers
_CAUCHY, _DCS = 1.0, 5.0
_APART_M = 1.0
_MOST_TRIED = 60
_FIXED = 1e-4  # deviation of the first pose


class Tie(NamedTuple):
    """A closure between two poses (indices): what the second is seen at from the first (3,), and its covariance (3, 3)."""

    first: int
    second: int
    pose_first_second: FloatArray
    covariance: FloatArray


class Judgement(NamedTuple):
    """Which closures count: `kept` (K,), those on which both methods disagree (K,), squared Mahalanobis distances (K,) at the end.

    `apart_m`: how far the paths of both methods are apart at most.
    """

    kept: Flags
    doubtful: Flags
    chi2: FloatArray
    apart_m: float


def judged(poses: FloatArray, steps: Sequence[FloatArray], ties: Sequence[Tie]) -> Judgement:
    """Return which closures of a path at `poses` (N, 3) are to be believed.

    `steps`: covariances (3, 3) of the N - 1 steps from pose to pose, in the axes of their ends.
    """
    if not ties:
        return Judgement(np.zeros(0, bool), np.zeros(0, bool), np.zeros(0), 0.0)
    problem = _Problem(poses, steps, ties)
    by_gnc, gnc_poses = problem.graduated()
    by_kernels, kernel_poses = problem.kernels()
    apart_m = float(np.hypot(*(gnc_poses - kernel_poses)[:, :2].T).max())
    doubtful = by_gnc != by_kernels
    kept = problem.with_more(by_gnc & by_kernels if apart_m > _APART_M else by_gnc)
    chi2 = problem.chi2(problem.solved(kept)[0])
    kept &= chi2 < _CHI2_9999
    return Judgement(kept, doubtful & ~kept, chi2, apart_m)


class _Problem:
    """The pose graph of the poses that have closures; the steps between are put together."""

    def __init__(self, poses: FloatArray, steps: Sequence[FloatArray], ties: Sequence[Tie]) -> None:
        import gtsam

        ends = {0, len(poses) - 1, *(tie.first for tie in ties), *(tie.second for tie in ties)}
        rows = sorted(ends)
        number = {row: index for index, row in enumerate(rows)}
        self._ties = [tie._replace(first=number[tie.first], second=number[tie.second]) for tie in ties]
        self._poses = poses[rows]
        self._odometry = gtsam.NonlinearFactorGraph()
        self._odometry.add(
            gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), gtsam.noiseModel.Isotropic.Sigma(3, _FIXED))
        )
        for index, (a, b) in enumerate(pairwise(rows)):
            noise = gtsam.noiseModel.Gaussian.Covariance(_together(poses, steps, a, b))
            step = gtsam.Pose2(*se2.between(poses[a], poses[b]))
            self._odometry.add(gtsam.BetweenFactorPose2(index, index + 1, step, noise))

    def graduated(self) -> tuple[Flags, FloatArray]:
        """Return the inliers (K,) of GNC with truncated least squares, and the poses."""
        import gtsam

        graph = self._graph(np.ones(len(self._ties), bool))
        parameters = gtsam.GncLMParams()
        parameters.setLossType(gtsam.GncLossType.TLS)
        parameters.setKnownInliers(list(range(self._odometry.size())))
        optimizer = gtsam.GncLMOptimizer(graph, self._start(self._poses), parameters)
        optimizer.setInlierCostThresholdsAtProbability(_PROBABILITY)
        found = optimizer.optimize()
        weights = np.array(optimizer.getWeights())[self._odometry.size() :]
        return weights > 0.5, self._read(found)

    def kernels(self) -> tuple[Flags, FloatArray]:
        """Return the closures (K,) that agree with Cauchy's kernel followed by dynamic covariance scaling, and the poses."""
        import gtsam

        kernels = gtsam.noiseModel.mEstimator
        everything = np.ones(len(self._ties), bool)
        poses = self._optimized(self._graph(everything, kernels.Cauchy.Create(_CAUCHY)), self._poses)
        poses = self._optimized(self._graph(everything, kernels.DCS.Create(_DCS)), poses)
        return self.chi2(poses) < _CHI2_999, poses

    def solved(self, kept: Flags) -> tuple[FloatArray, float]:
        """Return the poses by plain least squares over the closures kept, and their cost (squared Mahalanobis distances)."""
        import gtsam

        graph = self._graph(kept)
        found = gtsam.LevenbergMarquardtOptimizer(graph, self._start(self._poses)).optimize()
        return self._read(found), 2.0 * graph.error(found)

    def with_more(self, kept: Flags) -> Flags:
        """Return the closures kept and those refused that cost no more than a right one does: lone ones are lost on the way."""
        kept = kept.copy()
        poses, cost = self.solved(kept)
        refused = np.flatnonzero(~kept)
        for index in refused[np.argsort(self.chi2(poses)[refused])][:_MOST_TRIED].tolist():
            kept[index] = True
            tried = self.solved(kept)[1]
            if tried - cost < _CHI2_9999:
                cost = tried
            else:
                kept[index] = False
        return kept

    def chi2(self, poses: FloatArray) -> FloatArray:
        """Return the squared Mahalanobis distance (K,) of each closure at these poses."""
        out = np.empty(len(self._ties))
        for index, tie in enumerate(self._ties):
            gap = se2.between(tie.pose_first_second, se2.between(poses[tie.first], poses[tie.second]))
            gap[2] = math.remainder(gap[2], 2.0 * math.pi)
            out[index] = float(gap @ np.linalg.solve(tie.covariance, gap))
        return out

    def _graph(self, used: Flags, kernel: Any = None) -> Any:
        import gtsam

        graph = gtsam.NonlinearFactorGraph(self._odometry)
        for tie, use in zip(self._ties, used, strict=True):
            if not use:
                continue
            noise: Any = gtsam.noiseModel.Gaussian.Covariance(tie.covariance)
            if kernel is not None:
                noise = gtsam.noiseModel.Robust.Create(kernel, noise)
            graph.add(gtsam.BetweenFactorPose2(tie.first, tie.second, gtsam.Pose2(*tie.pose_first_second), noise))
        return graph

    def _optimized(self, graph: Any, poses: FloatArray) -> FloatArray:
        import gtsam

        return self._read(gtsam.LevenbergMarquardtOptimizer(graph, self._start(poses)).optimize())

    def _start(self, poses: FloatArray) -> Any:
        import gtsam

        values = gtsam.Values()
        for index, pose in enumerate(poses):
            values.insert(index, gtsam.Pose2(*pose))
        return values

    def _read(self, values: Any) -> FloatArray:
        found = [values.atPose2(index) for index in range(len(self._poses))]
        return np.array([[pose.x(), pose.y(), pose.theta()] for pose in found])


def _together(poses: FloatArray, steps: Sequence[FloatArray], first: int, last: int) -> FloatArray:
    """Return the covariance (3, 3) of the way from one pose to a later one, in the axes of its end."""
    covariance = steps[first]
    for row in range(first + 1, last):
        step = se2.between(poses[row], poses[row + 1])
        covariance = se2.composed_covariance(covariance, step, steps[row])
    return covariance
