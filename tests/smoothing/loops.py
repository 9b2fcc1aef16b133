"""Paths with closures, some of them false, whose truth is known; solved apart from the code under test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import gtsam
import numpy as np
import numpy.typing as npt
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.robust import Tie

Falsehood = Literal["random", "block"]
TIE_SIGMAS = np.array([0.05, 0.05, math.radians(0.5)])
_STEP_SIGMAS = np.array([0.02, 0.01, math.radians(0.05)])  # of a step of a metre
_PRIOR = np.full(3, 1e-4)


class Loops(NamedTuple):
    """True poses (N, 3), those of an odometry, covariances of its steps, closures, and which of these are right (K,)."""

    true: FloatArray
    odometry: FloatArray
    steps: list[FloatArray]
    ties: list[Tie]
    right: npt.NDArray[np.bool_]


def twice_round(
    seed: int,
    kind: Falsehood = "random",
    share: float = 0.3,
    *,
    count: int = 500,
    right: int = 30,
    step_m: float = 2.0,
) -> Loops:
    """Two laps of a circle, closed where they meet; `share` of all closures is false.

    False ones join poses anywhere (`random`), or tell all the same lie: one stretch is taken for another (`block`).
    """
    rng = np.random.default_rng(seed)
    lap_m = 0.5 * count * step_m
    way = step_m * np.arange(count)
    angle, radius = 2.0 * np.pi * way / lap_m, lap_m / (2.0 * np.pi)
    true = np.column_stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle])
    sigmas = _STEP_SIGMAS * math.sqrt(step_m)
    odometry = [true[0]]
    for before, after in pairwise(true):
        odometry.append(se2.compose(odometry[-1], se2.between(before, after) + rng.normal(0.0, sigmas)))
    met = [(k, k + count // 2) for k in range(count // 2)]
    pairs = [met[k] for k in rng.choice(len(met), right, replace=False)]
    covariance = np.diag(TIE_SIGMAS**2)
    ties = [
        Tie(i, j, se2.between(true[i], true[j]) + rng.normal(0.0, TIE_SIGMAS), covariance) for i, j in sorted(pairs)
    ]
    lies = _lies(rng, kind, round(right * share / (1.0 - share)) if share < 1.0 else right, count)
    if share >= 1.0:
        ties = []
    flags = np.array([True] * len(ties) + [False] * len(lies), dtype=np.bool_)
    return Loops(true, np.array(odometry), [np.diag(sigmas**2)] * (count - 1), ties + lies, flags)


def _lies(rng: np.random.Generator, kind: Falsehood, count: int, poses: int) -> list[Tie]:
    covariance = np.diag(TIE_SIGMAS**2)
    if kind == "random":
        ends = [sorted(rng.choice(poses, 2, replace=False).tolist()) for _ in range(count)]
        return [Tie(i, j, rng.normal(0.0, [1.0, 1.0, 0.3]), covariance) for i, j in ends]
    first, second = int(rng.integers(0, poses // 5)), int(rng.integers(poses // 2, 3 * poses // 4))
    # not by chance where the laps do meet
    second += 0 if abs(second - first - poses // 2) > poses // 20 else 2 * poses // 25
    width = min(60, poses // 8)
    return [Tie(first + k % width, second + k % width, rng.normal(0.0, TIE_SIGMAS), covariance) for k in range(count)]


def least_squares(loops: Loops, used: npt.NDArray[np.bool_]) -> FloatArray:
    """Return the poses (N, 3) of all steps and the closures used: plain least squares, no pose left out."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*loops.odometry[0]), gtsam.noiseModel.Diagonal.Sigmas(_PRIOR)))
    for row, pose in enumerate(loops.odometry):
        values.insert(row, gtsam.Pose2(*pose))
    for row, (before, after) in enumerate(pairwise(loops.odometry)):
        _add(graph, row, row + 1, se2.between(before, after), loops.steps[row])
    for tie, use in zip(loops.ties, used, strict=True):
        if use:
            _add(graph, tie.first, tie.second, tie.pose_first_second, tie.covariance)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = [found.atPose2(row) for row in range(len(loops.odometry))]
    return np.array([[pose.x(), pose.y(), pose.theta()] for pose in poses])


def _add(graph: Any, first: int, second: int, pose: FloatArray, covariance: FloatArray) -> None:
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    graph.add(gtsam.BetweenFactorPose2(first, second, gtsam.Pose2(*pose), noise))


def rmse_m(loops: Loops, poses: FloatArray) -> float:
    """Return the error of the path in the frame of its first pose, m."""
    return float(np.sqrt(((poses - loops.true)[:, :2] ** 2).sum(axis=1).mean()))


def moved(loops: Loops, T: FloatArray) -> Loops:
    """Return the same path elsewhere."""
    true, odometry = (np.array([se2.compose(T, pose) for pose in path]) for path in (loops.true, loops.odometry))
    return loops._replace(true=true, odometry=odometry)


def in_order(loops: Loops, order: Sequence[int]) -> Loops:
    """Return the same path with its closures in another order."""
    return loops._replace(ties=[loops.ties[k] for k in order], right=loops.right[list(order)])
