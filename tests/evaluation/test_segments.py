"""Segment errors, end point, components and reach of drives whose errors are known by construction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.errors import UsageError
from lhdmap.evaluation.planar_segments import planar_segments
from lhdmap.evaluation.trajectory import TrajectoryEvaluationSettings, evaluate_trajectory
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

from tests.evaluation.paths import arc, moved, part, straight, trajectory, wandering


def test_scale_error_is_the_translation_error_of_every_segment() -> None:
    found = evaluate_trajectory(straight(120.0, scale=1.01), straight(120.0))
    assert [segment.length_m for segment in found.segments] == [5.0, 10.0, 20.0, 50.0, 100.0]
    for segment in found.segments:
        assert segment.translation_pct == pytest.approx(1.0, abs=1e-9)
        assert segment.rotation_deg_per_m == pytest.approx(0.0, abs=1e-12)
    assert found.end_pct == pytest.approx(1.0, abs=1e-9)


def test_number_of_segments_follows_from_the_start_every_half_metre() -> None:
    found = evaluate_trajectory(straight(20.0), straight(20.0), TrajectoryEvaluationSettings(segments_m=(5.0, 20.0)))
    assert [segment.n for segment in found.segments] == [31, 1]


def test_heading_bias_gives_known_rotation_and_translation_errors() -> None:
    bias = math.radians(0.02)
    found = evaluate_trajectory(arc(30.0, 40.0, bias_rad_per_m=bias), arc(30.0, 40.0))
    ten = next(segment for segment in found.segments if segment.length_m == 10.0)
    assert ten.rotation_deg_per_m == pytest.approx(0.02, rel=1e-6)
    ends = [np.array([math.sin(r * 10), 1 - math.cos(r * 10)]) / r for r in (1 / 30.0, 1 / 30.0 + bias)]
    assert ten.translation_pct == pytest.approx(
        100 * np.linalg.norm(ends[1] - ends[0]) / 10.0, rel=0.01
    )  # a step of 5 cm


def test_segments_do_not_depend_on_the_frames() -> None:
    truth, estimate = wandering(1), wandering(2)
    estimate = estimate._replace(positions_m=truth.positions_m * 1.02)
    before = evaluate_trajectory(estimate, truth)
    after = evaluate_trajectory(moved(estimate, (0.1, -0.2, 2.0), (50.0, -3.0, 7.0)), truth)
    for one, other in zip(before.segments, after.segments, strict=True):
        assert other.n == one.n
        if one.translation_pct is not None:
            assert other.translation_pct == pytest.approx(one.translation_pct, rel=1e-9)
            assert other.rotation_deg_per_m == pytest.approx(one.rotation_deg_per_m, rel=1e-6)


def test_too_short_a_drive_is_said_in_words_and_gives_null_not_nan() -> None:
    found = evaluate_trajectory(straight(12.0), straight(12.0))
    values = found.to_json()["segments"]
    assert [row["n"] for row in values] == [15, 5, 0, 0, 0]
    assert values[2]["translation_pct"] is None
    assert values[2]["rotation_deg_per_m"] is None
    assert "no segment of 20, 50, 100 m: the compared path is 12.0 m long" in found.warnings


def test_a_machine_that_stands_does_not_weigh_more() -> None:
    moving, standing = straight(10.0), 3000
    held = [np.vstack([np.repeat(array[:1], standing, axis=0), array]) for array in moving[1:]]
    stamps = moving.stamps_ns[0] + 20_000_000 * np.arange(standing + len(moving.stamps_ns))
    truth = Trajectory(stamps, held[0], held[1])
    found = evaluate_trajectory(truth, truth)
    assert found.segments[0].n == 11
    assert found.distance_m == pytest.approx(10.0)


def test_components_are_taken_in_the_true_heading_frame() -> None:
    s = np.arange(0, 30, 0.1)
    heading = np.full(len(s), math.radians(120.0))
    rpy = np.column_stack([0 * s, 0 * s, heading])
    ahead, left = (np.array([math.cos(a), math.sin(a), 0.0]) for a in (heading[0], heading[0] + math.pi / 2))
    truth = trajectory(s[:, None] * ahead, rpy)
    estimate = trajectory(truth.positions_m + 0.3 * ahead - 0.2 * left + [0, 0, 0.1], rpy)
    found = evaluate_trajectory(estimate, truth, TrajectoryEvaluationSettings(alignment="none"))
    assert found.components == pytest.approx((0.3, 0.2, 0.1))
    assert found.profile.errors_m[5] == pytest.approx([0.3, -0.2, 0.1])
    assert found.ape_m.rmse == pytest.approx(math.sqrt(0.14))


@pytest.mark.parametrize(("kept", "share"), [(slice(0, 501), 0.5), (slice(0, None), 1.0)])
def test_reach_is_the_share_of_the_true_path_that_is_covered(kept: slice, share: float) -> None:
    truth = straight(50.0)
    estimate = part(truth, kept)
    found = evaluate_trajectory(estimate, truth)
    assert found.reach == pytest.approx(share, abs=0.03)  # half a second at 2.5 m/s beyond the last pose still counts


@pytest.mark.parametrize("length_m", [250.0, 60.0])
def test_heading_drift_is_that_of_a_hundred_metres(length_m: float) -> None:
    """A heading that is off by 0.1 mrad more each metre drifts by 10 mrad over 100 m, however long the drive is."""
    found = evaluate_trajectory(arc(40.0, length_m, bias_rad_per_m=1e-4), arc(40.0, length_m))
    assert found.heading_drift_deg == pytest.approx(math.degrees(1e-2), rel=1e-3)
    assert found.to_json()["heading_drift_deg_per_100m"] == found.heading_drift_deg


def test_reach_counts_a_hole_in_the_middle() -> None:
    truth = straight(100.0)
    rows = np.r_[0:600, 1400:2001]
    found = evaluate_trajectory(part(truth, rows), truth)
    assert found.reach == pytest.approx(0.6, abs=0.03)


def test_standing_still_has_no_heading_drift() -> None:
    still = trajectory(np.zeros((10, 3)), np.zeros((10, 3)))
    assert evaluate_trajectory(still, still).heading_drift_deg is None


def test_standing_still_is_no_division_by_zero() -> None:
    still = trajectory(np.zeros((50, 3)), np.zeros((50, 3)))
    found = evaluate_trajectory(still, still)
    assert found.end_pct is None
    assert found.reach == 1.0
    assert found.to_json()["rpe"]["rmse"] is None


def test_planar_comparison_leaves_height_roll_and_pitch_out() -> None:
    truth = wandering(3)
    flat = evaluate_trajectory(truth, truth, TrajectoryEvaluationSettings(planar=True))
    estimate = truth._replace(positions_m=truth.positions_m * [1.0, 1.0, 0.0])
    found = evaluate_trajectory(estimate, truth, TrajectoryEvaluationSettings(planar=True))
    assert found.ape_m.max == pytest.approx(0.0, abs=1e-9)
    assert found.distance_m == pytest.approx(flat.distance_m)
    climbing = truth._replace(positions_m=truth.positions_m + np.linspace([0, 0, 0], [0, 0, 2], len(truth.stamps_ns)))
    level = truth._replace(positions_m=truth.positions_m * [1.0, 1.0, 0.0])
    assert any("--planar" in text for text in evaluate_trajectory(level, climbing).warnings)


@pytest.mark.parametrize(
    "settings",
    [
        TrajectoryEvaluationSettings(segments_m=()),
        TrajectoryEvaluationSettings(segments_m=(0.0,)),
        TrajectoryEvaluationSettings(rpe_delta=0.0),
        TrajectoryEvaluationSettings(rpe_delta=1.5, rpe_unit="frames"),
        TrajectoryEvaluationSettings(alignment="sim3"),
    ],
)
def test_options_without_meaning_are_refused(settings: TrajectoryEvaluationSettings) -> None:
    with pytest.raises(UsageError):
        evaluate_trajectory(straight(10.0), straight(10.0), settings)


def test_planar_segments_are_those_of_space() -> None:
    """The means of the errors as vectors are those of the evaluation, which goes by 3D poses and rotation matrices."""
    estimate, truth = arc(30.0, 40.0, bias_rad_per_m=math.radians(0.02)), arc(30.0, 40.0)
    found = planar_segments(_planar(estimate), _planar(truth))
    ten = next(one for one in evaluate_trajectory(estimate, truth).segments if one.length_m == 10.0)
    assert len(found.vectors) == pytest.approx(ten.n, rel=0.1)  # there a start is a row at least half a metre on
    assert found.translation_pct == pytest.approx(ten.translation_pct, rel=0.01)  # there divided by the way driven
    assert found.rotation_deg_per_m == pytest.approx(ten.rotation_deg_per_m, rel=0.01)
    assert found.worst_pct >= found.translation_pct


def test_a_path_shorter_than_a_planar_segment_is_refused() -> None:
    with pytest.raises(UsageError, match=r"3\.0 m long: segments of 10 m"):
        planar_segments(_planar(straight(3.0)), _planar(straight(3.0)))


def _planar(one: Trajectory) -> FloatArray:
    heading = se3.rpy_from_quaternions(one.quaternions_xyzw)[:, 2]
    return np.column_stack([one.positions_m[:, :2], heading])
