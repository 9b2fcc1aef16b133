"""APE and RPE beside evo, the field's reference tool (a development tool only: the package does not use it)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lhdmap.evaluation.metrics import statistics
from lhdmap.evaluation.trajectory import TrajectoryEvaluationSettings, evaluate_trajectory
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

from tests.evaluation.paths import disturbed, moved, wandering

evo_metrics = pytest.importorskip("evo.core.metrics", reason="evo is a development tool: pip install lhdmap[dev]")
NAMES = ("rmse", "mean", "median", "std", "min", "max")


def evo_path(path: Trajectory) -> Any:
    from evo.core.trajectory import PoseTrajectory3D

    return PoseTrajectory3D(path.positions_m, np.roll(path.quaternions_xyzw, 1, axis=1), path.stamps_ns / 1e9)


def evo_statistics(metric: Any, truth: Any, estimate: Any) -> FloatArray:
    metric.process_data((truth, estimate))
    found = metric.get_all_statistics()
    return np.array([found[name] for name in NAMES])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_ape_after_least_squares_alignment(seed: int) -> None:
    truth = wandering(seed)
    estimate = moved(disturbed(truth, seed + 10), (0.2, -0.1, 1.5), (4.0, 5.0, 6.0))
    found = evaluate_trajectory(estimate, truth, TrajectoryEvaluationSettings(alignment="se3"))
    theirs = evo_path(estimate)
    theirs.align(evo_path(truth))
    expected = evo_statistics(evo_metrics.APE(evo_metrics.PoseRelation.translation_part), evo_path(truth), theirs)
    assert np.array(found.ape_m) == pytest.approx(expected, rel=1e-9)


def test_ape_after_origin_alignment_of_a_level_drive() -> None:
    truth = wandering(3)
    level = truth._replace(positions_m=truth.positions_m * [1, 1, 0])
    planar = TrajectoryEvaluationSettings(planar=True)
    estimate = disturbed(level, 30)
    found = evaluate_trajectory(estimate, level, planar)
    from lhdmap.evaluation.poses import headings, poses_from_quaternions

    from tests.evaluation.paths import trajectory

    def flat(path: Trajectory) -> Any:
        heading = headings(poses_from_quaternions(path.positions_m, path.quaternions_xyzw))
        rpy = np.column_stack([0 * heading, 0 * heading, heading])
        return evo_path(trajectory(path.positions_m * [1, 1, 0], rpy, path.stamps_ns))

    theirs = flat(estimate)
    theirs.align_origin(flat(level))
    expected = evo_statistics(evo_metrics.APE(evo_metrics.PoseRelation.translation_part), flat(level), theirs)
    assert np.array(found.ape_m) == pytest.approx(expected, rel=1e-7, abs=1e-12)


@pytest.mark.parametrize(("delta", "unit"), [(1.0, "frames"), (7.0, "frames"), (1.0, "m"), (2.5, "m")])
def test_rpe_translation_and_rotation(delta: float, unit: str) -> None:
    truth = wandering(4)
    estimate = disturbed(truth, 40)
    found = evaluate_trajectory(estimate, truth, TrajectoryEvaluationSettings(rpe_delta=delta, rpe_unit=unit)).rpe
    kinds = (evo_metrics.PoseRelation.translation_part, evo_metrics.PoseRelation.rotation_angle_deg)
    for kind, errors in zip(kinds, (found.translation_m, found.rotation_deg), strict=True):
        steps = evo_metrics.Unit.frames if unit == "frames" else evo_metrics.Unit.meters
        metric = evo_metrics.RPE(kind, delta, steps, all_pairs=False, pairs_from_reference=True)
        expected = evo_statistics(metric, evo_path(truth), evo_path(estimate))
        assert np.array(statistics(errors)) == pytest.approx(expected, rel=1e-6)
