"""Alignments recover a known motion, and say so where they cannot."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import UsageError
from lhdmap.evaluation.alignment import align, aligned
from lhdmap.evaluation.poses import Poses, poses_from_quaternions

from tests.evaluation.paths import moved, straight, wandering

ANGLE = st.floats(-3.0, 3.0)
OFFSET = st.tuples(*[st.floats(-100.0, 100.0)] * 3)


def poses(path: object) -> Poses:
    return poses_from_quaternions(path.positions_m, path.quaternions_xyzw)  # type: ignore[attr-defined]


@settings(max_examples=25, deadline=None)
@given(ANGLE, OFFSET)
def test_origin_and_se2_undo_a_turn_about_z_and_a_shift(yaw: float, offset: tuple[float, float, float]) -> None:
    truth = wandering(4)
    estimate = poses(moved(truth, (0.0, 0.0, yaw), offset))
    for method in ("origin", "se2"):
        found = align(estimate, poses(truth), method)
        assert found.used == method
        assert np.abs(aligned(estimate, found).positions_m - truth.positions_m).max() < 1e-8


@settings(max_examples=25, deadline=None)
@given(ANGLE, ANGLE, OFFSET)
def test_se3_undoes_any_motion(roll: float, yaw: float, offset: tuple[float, float, float]) -> None:
    truth = wandering(5)
    estimate = poses(moved(truth, (roll, 0.3, yaw), offset))
    found = aligned(estimate, align(estimate, poses(truth), "se3"))
    assert np.abs(found.positions_m - truth.positions_m).max() < 1e-7
    assert np.abs(found.rotations - poses(truth).rotations).max() < 1e-7


def test_origin_leaves_roll_and_pitch_alone() -> None:
    truth = straight(60.0)
    tilted = poses(moved(truth, (0.0, np.radians(0.1), 0.0), (0.0, 0.0, 0.0)))
    found = aligned(tilted, align(tilted, poses(truth), "origin"))
    assert found.positions_m[-1, 2] == pytest.approx(-60.0 * np.sin(np.radians(0.1)))


def test_a_straight_path_falls_back_to_origin_and_says_so() -> None:
    path = poses(straight(100.0))
    found = align(path, path, "se3")
    assert found.used == "origin"
    assert "straight" in found.warning
    assert align(path, path, "se2").used == "se2"


def test_a_path_without_extent_falls_back_to_origin() -> None:
    path = poses(straight(100.0))
    still = Poses(np.zeros_like(path.positions_m), path.rotations)
    found = align(still, path, "se2")
    assert found.used == "origin"
    assert "no extent" in found.warning


def test_none_moves_nothing() -> None:
    path = poses(wandering(6))
    assert np.array_equal(aligned(path, align(path, path, "none")).positions_m, path.positions_m)


def test_unknown_alignment_lists_the_known_ones() -> None:
    path = poses(straight(1.0))
    with pytest.raises(UsageError, match="none, origin, se2, se3"):
        align(path, path, "sim3")
