"""The fixed-lag smoother: poses are better than the filter's, honest, and a place that has changed does not carry them away."""

from __future__ import annotations

import math

import numpy as np
from lhdmap.geometry import se2
from lhdmap.localization.fixed_lag import Belief, FixedLag, LagPlaced, LagStep
from lhdmap.messages import FloatArray

STEP_M = 0.1
STEP_STD = np.array([0.004, 0.003, math.radians(0.05)])
SEEN_STD = np.array([0.05, 0.02, math.radians(0.3)])


def _turned(P: FloatArray, heading_rad: float) -> FloatArray:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(R @ P @ R.T, dtype=float)


def _run(
    seed: int, wrong: range = range(0), turned: bool = False
) -> tuple[FloatArray, FloatArray, dict[int, LagPlaced]]:
    """Filter and smooth a drive of 60 m with odometry and scans that see the map; return truth, filtered, smoothed."""
    rng = np.random.default_rng(seed)
    lag, true, odometry = FixedLag(), np.zeros(3), np.array([5.0, -3.0, 1.0])
    belief = Belief(np.zeros(3), np.diag([1e-4, 1e-4, 1e-6]))
    truths, filtered, out = [], [], {}
    for k in range(600):
        step = np.array([STEP_M, 0.0, 0.02 * math.sin(0.02 * k)])
        true = se2.compose(true, step)
        read = step + STEP_STD * math.sqrt(STEP_M) * rng.standard_normal(3)
        odometry = se2.compose(odometry, read)
        noise = np.diag(STEP_STD**2 * STEP_M)
        before_pose = se2.compose(belief.pose, read)
        d = before_pose[:2] - belief.pose[:2]
        F = np.array([[1.0, 0.0, -d[1]], [0.0, 1.0, d[0]], [0.0, 0.0, 1.0]])
        before = Belief(before_pose, F @ belief.P @ F.T + _turned(noise, before_pose[2]))
        after = before
        if k % 10 == 0:
            z = se2.compose(true, SEEN_STD * rng.standard_normal(3))
            if k in wrong:
                z = z + np.array([0.6, 0.3, 0.0])
            R = _turned(np.diag(SEEN_STD**2), true[2])
            P = np.linalg.inv(np.linalg.inv(before.P) + np.linalg.inv(R))
            after = Belief(before.pose + P @ np.linalg.solve(R, z - before.pose), P)
        belief = after
        turn = float(step[2]) if turned else None
        for one in lag.take(LagStep(k, odometry, noise, turn), before, after):
            out[one.row] = one
        truths.append(true)
        filtered.append(belief.pose)
    for one in lag.restart():
        out[one.row] = one
    return np.array(truths), np.array(filtered), out


def _errors(truth: FloatArray, found: dict[int, LagPlaced]) -> FloatArray:
    return np.array([se2.between(truth[row], one.pose) for row, one in sorted(found.items())])


def test_each_row_comes_once_and_is_better() -> None:
    gains = []
    for seed in range(5):
        truth, filtered, out = _run(seed)
        assert sorted(out) == list(range(600))
        before = np.array([se2.between(a, b) for a, b in zip(truth, filtered, strict=True)])
        gains.append((_errors(truth, out) ** 2).mean(axis=0) / (before**2).mean(axis=0))
    assert np.all(np.mean(gains, axis=0) < [1.0, 0.9, 0.8])


def test_stated_deviations_are_true() -> None:
    sigmas = []
    for seed in range(5):
        truth, _, out = _run(seed)
        errors = _errors(truth, out)[50:-150:20]
        stated = np.array([np.sqrt(np.diag(out[row].covariance)) for row in sorted(out)])[50:-150:20]
        sigmas.append(errors / stated)
    rms = np.sqrt(np.mean(np.concatenate(sigmas) ** 2, axis=0))
    assert np.all(rms < 1.5)
    assert np.all(rms > 0.4)


def test_what_is_wrong_for_a_moment_does_not_carry_it_away() -> None:
    truth, filtered, out = _run(1, wrong=range(300, 330))
    off = np.hypot(*(filtered - truth)[300:340, :2].T).max()
    errors = _errors(truth, out)
    assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.5 * off


def test_a_gyroscope_steadies_the_heading() -> None:
    without, with_one = (np.std(_errors(t, o)[:, 2]) for t, _, o in (_run(2), _run(2, turned=True)))
    assert with_one < without
